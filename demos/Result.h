#pragma once
#include <iosfwd>
#include <vector>

#include "Measure.h"

namespace jacket::demo {

enum ExitCode { kOk = 0, kInternalError = 1, kBadInput = 2, kNotConverged = 3, kNotFinite = 4, kInterrupted = 130 };

/// What a run is summed up to: result.json, and the summary on the screen.
class Result {
  public:
    explicit Result(const World& start);
    void add(const FrameRecord& frame);

    Json json(const World& end) const;
    ExitCode exitCode() const;

  private:
    double momentumError() const;  ///< largest over the run

    FrameRecord m_start, m_end;
    Vec3 m_weight;  ///< moving mass times gravity [N]
    std::vector<double> m_msPerStep;
    FrameRecord m_deepest;  ///< the frame of the deepest penetration
    double m_peakStretch, m_momentumDrift = 0.0, m_momentumScale = 0.0, m_wall = 0.0;
    double m_iterations = 0.0;  ///< over all steps
    int m_mostIterations = 0, m_substeps;
    bool m_converged = true, m_finite;
    struct Yielding {
        Dent most;  ///< of the frame with the most plastic work
        double time = 0.0;
    };
    std::vector<Yielding> m_yielding;  ///< of each shell
};

/// A page for people, from result.json.
void printSummary(std::ostream& out, const Json& result);

}  // namespace jacket::demo
