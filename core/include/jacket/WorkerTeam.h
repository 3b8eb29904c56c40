#pragma once
#include <algorithm>
#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

namespace jacket {

/// Threads that share the parts of one piece of work with the thread that asks for it. Between two pieces they wait:
/// awake for some tens of microseconds, then asleep. One thread at a time may ask.
class WorkerTeam {
  public:
    /// `threads` includes the one that asks: 1 starts none. Throws std::invalid_argument below 1, std::system_error
    /// where the system has no more.
    explicit WorkerTeam(int threads);
    ~WorkerTeam();
    WorkerTeam(const WorkerTeam&) = delete;
    WorkerTeam& operator=(const WorkerTeam&) = delete;

    int threads() const { return static_cast<int>(m_workers.size()) + 1; }

    /// Calls part(i) once for every i = 0 ... count-1, and returns when all calls have. The thread that asks takes the
    /// first ones and the others take the last ones, until these meet: in loops over the same data, much of it stays
    /// with the same core. The calls must not throw, nor ask this team for anything.
    template <class Part>
    void run(int count, const Part& part) {
        share(
            count, [](const void* work, int i) { (*static_cast<const Part*>(work))(i); }, &part);
    }

  private:
    using Call = void (*)(const void*, int);
    enum class End { First, Last };
    void share(int count, Call call, const void* work);
    void shareSome(int begin, int count);
    bool doPart(End from);
    void waitForWork();
    void dismiss();
    /// Number of the piece of work in the upper half; in the quarters below it, which of its parts nobody has taken:
    /// the first of them, and the one behind the last.
    alignas(64) std::atomic<std::uint64_t> m_left{0};
    std::atomic<Call> m_call{nullptr};
    std::atomic<const void*> m_work{nullptr};
    std::atomic<int> m_begin{0};                         ///< what its parts are counted from
    alignas(64) std::atomic<int> m_done{0};              ///< of them
    alignas(64) std::atomic<std::uint32_t> m_pieces{0};  ///< that were ever begun: what sleeping workers wait for
    std::atomic<bool> m_isOver{false};
    std::vector<std::thread> m_workers;
};

/// The same, by this thread alone where there is no team.
template <class Part>
void runParts(WorkerTeam* team, int count, const Part& part) {
    if (team && count > 1) return team->run(count, part);
    for (int i = 0; i < count; ++i) part(i);
}

/// Calls part(begin, end) for the ranges of `length` (the last one may be shorter) that 0 ... size-1 falls into.
template <class Part>
void runRanges(WorkerTeam* team, int size, int length, const Part& part) {
    const auto one = [&](int i) { part(i * length, std::min((i + 1) * length, size)); };
    runParts(team, (size + length - 1) / length, one);
}

}  // namespace jacket
