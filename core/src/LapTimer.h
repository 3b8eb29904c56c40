#pragma once
#include "jacket/Island.h"

namespace jacket {

/// Gives the time since the last call, by the caller's clock if there is one.
class LapTimer {
  public:
    explicit LapTimer(const IslandInput& input) : m_clock(input.clock), m_last(m_clock ? m_clock() : 0.0) {}
    void addTo(double& sum) {
        if (!m_clock) return;
        const double now = m_clock();
        sum += now - m_last;
        m_last = now;
    }

  private:
    double (*m_clock)();
    double m_last;
};

}  // namespace jacket
