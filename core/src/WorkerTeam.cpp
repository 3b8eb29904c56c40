#include "jacket/WorkerTeam.h"

#include <stdexcept>
#include <string>

namespace jacket {
namespace {

constexpr int kAwake = 1000;  ///< pauses of some 40 ns each before a waiting thread lets others have the processor

void pause() {
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#endif
}

constexpr int kMostParts = 0xffff;  ///< of one piece of work
constexpr std::uint64_t kOneFirst = std::uint64_t{1} << 16;

/// What WorkerTeam::m_left says.
int firstIn(std::uint64_t left) {
    return static_cast<int>(left >> 16 & 0xffffu);
}
int endIn(std::uint64_t left) {
    return static_cast<int>(left & 0xffffu);
}

}  // namespace

WorkerTeam::WorkerTeam(int threads) {
    if (threads < 1) throw std::invalid_argument("WorkerTeam: threads must be >= 1, got " + std::to_string(threads));
    m_workers.reserve(threads - 1);
    try {
        for (int i = 1; i < threads; ++i) m_workers.emplace_back([this] { waitForWork(); });
    } catch (...) {  // the system has no more threads
        dismiss();
        throw;
    }
}

WorkerTeam::~WorkerTeam() {
    dismiss();
}

void WorkerTeam::dismiss() {
    m_isOver.store(true);
    m_pieces.fetch_add(1);
    m_pieces.notify_all();
    for (std::thread& worker : m_workers) worker.join();
}

/// A part is taken by altering m_left from a value that still has one: then the piece of work is not over, so that
/// call, work and begin are its own. A worker that comes late takes nothing.
bool WorkerTeam::doPart(End from) {
    std::uint64_t left = m_left.load(std::memory_order_acquire);
    while (firstIn(left) < endIn(left)) {
        const Call call = m_call.load(std::memory_order_relaxed);
        const void* const work = m_work.load(std::memory_order_relaxed);
        const int begin = m_begin.load(std::memory_order_relaxed);
        const int part = from == End::First ? firstIn(left) : endIn(left) - 1;
        const std::uint64_t others = from == End::First ? left + kOneFirst : left - 1;
        if (!m_left.compare_exchange_weak(left, others, std::memory_order_acq_rel, std::memory_order_acquire)) continue;
        call(work, begin + part);
        m_done.fetch_add(1, std::memory_order_release);
        return true;
    }
    return false;
}

void WorkerTeam::share(int count, Call call, const void* work) {
    m_call.store(call, std::memory_order_relaxed);
    m_work.store(work, std::memory_order_relaxed);
    for (int begin = 0; begin < count; begin += kMostParts) shareSome(begin, std::min(kMostParts, count - begin));
}

void WorkerTeam::shareSome(int begin, int count) {
    m_begin.store(begin, std::memory_order_relaxed);
    m_done.store(0, std::memory_order_relaxed);
    const std::uint32_t piece = m_pieces.load(std::memory_order_relaxed) + 1;
    m_left.store(std::uint64_t{piece} << 32 | static_cast<std::uint32_t>(count), std::memory_order_release);
    m_pieces.store(piece);
    m_pieces.notify_all();  // costs little where nobody sleeps
    while (doPart(End::First)) {
    }
    int patience = kAwake;
    while (m_done.load(std::memory_order_acquire) < count)
        patience > 0 ? --patience, pause() : std::this_thread::yield();
}

void WorkerTeam::waitForWork() {
    for (std::uint32_t seen = 0;;) {
        std::uint32_t pieces = m_pieces.load();
        for (int waited = 0; pieces == seen && waited < kAwake; ++waited) {
            pause();
            pieces = m_pieces.load();
        }
        if (pieces == seen) m_pieces.wait(seen);
        if (m_isOver.load()) return;
        seen = m_pieces.load();
        while (doPart(End::Last)) {
        }
    }
}

}  // namespace jacket
