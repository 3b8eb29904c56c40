#pragma once

/// Where the ball of the trampoline problem rests [m]: its centre above the sheet's edges. Computed by
///     jacket report --reference
/// with patch bending on 80 x 80 cells with alternating diagonals, step 1/60 s, tolerance 1e-5.
namespace jacket::demo::accuracy {

inline constexpr const char* kTrampolineSource = "80 x 80 cells, step 1/60 s (jacket report --reference)";

inline constexpr double kTrampolineHeight = 0.122239;

/// How far the ball sinks from lying on the flat sheet [m].
inline constexpr double kTrampolineSag = 0.25 - kTrampolineHeight;

}  // namespace jacket::demo::accuracy
