#pragma once
#include <iosfwd>

#include "World.h"

namespace jacket::demo {

/// Where the wall time of a run went.
class Profile {
  public:
    void add(const FrameReport& frame, int steps, double secondsAround);  ///< around: measuring and writing the frame
    /// {"steps", "solves_per_step", "iterations_per_step", "parts": [{"part", "ms_per_step", "percent"}],
    /// "ms_per_step", "recording_ms_per_step"}; the parts sum up to ms_per_step.
    Json json() const;

  private:
    struct Part {
        const char* name;
        double seconds;
    };
    std::vector<Part> parts() const;

    int m_steps = 0, m_solves = 0, m_iterations = 0;
    double m_seconds = 0.0, m_around = 0.0;
    StepSeconds m_where;
};

/// A table for people, from Profile::json().
void printProfile(std::ostream& out, const Json& profile);

}  // namespace jacket::demo
