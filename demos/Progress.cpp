#include "Progress.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace jacket::demo {

namespace {

std::string duration(double seconds) {
    const int whole = static_cast<int>(seconds + 0.5);
    char text[32];
    if (whole < 60)
        std::snprintf(text, sizeof text, "%d s", whole);
    else if (whole < 3600)
        std::snprintf(text, sizeof text, "%d:%02d min", whole / 60, whole % 60);
    else
        std::snprintf(text, sizeof text, "%d:%02d h", whole / 3600, whole / 60 % 60);
    return text;
}

}  // namespace

Progress::Style Progress::styleFor(bool quiet) {
    if (quiet) return Style::None;
    return isatty(STDERR_FILENO) ? Style::Bar : Style::Lines;
}

Progress::Progress(std::ostream& out, Style style, std::string what, int items, double secondsPerItem)
    : m_out(out), m_style(style), m_what(std::move(what)), m_items(items), m_secondsPerItem(secondsPerItem) {}

Progress::~Progress() {
    if (m_style == Style::Bar) m_out << "\r\033[K" << std::flush;
}

std::string Progress::text(int done, double elapsed) const {
    char text[96];
    std::snprintf(text, sizeof text, "%3d %%  %d/%d", static_cast<int>(100.0 * done / m_items), done, m_items);
    std::string line = text;
    if (m_secondsPerItem > 0 && elapsed > 0) {
        std::snprintf(text, sizeof text, "  %.3g x real time", m_secondsPerItem * done / elapsed);
        line += text;
    }
    if (done > 0 && done < m_items) line += "  " + duration(elapsed * (m_items - done) / done) + " left";
    return line;
}

void Progress::update(int done) {
    if (m_style == Style::None || m_items <= 0) return;
    const auto now = Clock::now();
    const double elapsed = std::chrono::duration<double>(now - m_start).count();
    if (m_style == Style::Lines) {
        const int tenth = static_cast<int>(10LL * done / m_items);
        if (tenth > m_tenth) m_out << m_what << ' ' << text(done, elapsed) << std::endl;
        m_tenth = std::max(m_tenth, tenth);
        return;
    }
    constexpr auto kBetweenDraws = std::chrono::milliseconds(100);
    if (now - m_lastDrawn < kBetweenDraws && done < m_items) return;
    m_lastDrawn = now;
    constexpr int kWidth = 30;
    const int filled = static_cast<int>(static_cast<long long>(kWidth) * done / m_items);
    m_out << '\r' << m_what << " [" << std::string(filled, '#') << std::string(kWidth - filled, '.') << "] "
          << text(done, elapsed) << "\033[K" << std::flush;
}

}  // namespace jacket::demo
