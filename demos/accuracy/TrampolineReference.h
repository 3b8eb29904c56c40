#pragma once

/// Where the ball of the trampoline problem rests [m]: its centre above the sheet's edges. Computed by
///     jacket report --reference
/// with patch bending on 60 x 60 cells with alternating diagonals, step 1/240 s, tolerance 1e-4.
namespace jacket::demo::accuracy {

inline constexpr const char* kTrampolineSource = "60 x 60 cells, step 1/240 s (jacket report --reference)";

inline constexpr double kTrampolineHeight = 0.124817;

/// How far the ball sinks from lying on the flat sheet [m].
inline constexpr double kTrampolineSag = 0.25 - kTrampolineHeight;

}  // namespace jacket::demo::accuracy
