#pragma once
#include <chrono>
#include <ostream>
#include <string>

namespace jacket::demo {

/// Tells how far a job is: a bar that is redrawn on a terminal, a line every tenth otherwise.
class Progress {
  public:
    enum class Style { None, Lines, Bar };
    static Style styleFor(bool quiet);  ///< Bar if stderr is a terminal

    /// `secondsPerItem`: simulated time of one item, for the real-time factor; 0: none is shown.
    Progress(std::ostream& out, Style style, std::string what, int items, double secondsPerItem = 0.0);
    ~Progress();
    void update(int done);

  private:
    std::string text(int done, double elapsed) const;

    using Clock = std::chrono::steady_clock;
    std::ostream& m_out;
    Style m_style;
    std::string m_what;
    int m_items, m_tenth = 0;
    double m_secondsPerItem;
    Clock::time_point m_start = Clock::now(), m_lastDrawn{};
};

}  // namespace jacket::demo
