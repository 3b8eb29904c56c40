#pragma once

/// Where the tip of the heavy strip of Motion.cpp is, 30 times a second: x, y [m] from the clamp. Computed by
///     jacket report --reference
/// with patch bending on 80 x 20 cells with alternating diagonals, BDF2 with a step of 1/4800 s, tolerance 1e-5.
namespace jacket::demo::accuracy {

inline constexpr double kStripSeconds = 1.0;
inline constexpr int kStripRate = 30;  ///< samples per second
inline constexpr const char* kStripSource = "80 x 20 cells, BDF2, step 1/4800 s (jacket report --reference)";

inline constexpr double kStripTip[][2] = {
    {0.999947, -0.005476},
    {0.999388, -0.020077},
    {0.997400, -0.047906},
    {0.993402, -0.100250},
    {0.983193, -0.175937},
    {0.960232, -0.268120},
    {0.918452, -0.372432},
    {0.860666, -0.473466},
    {0.796148, -0.563026},
    {0.723370, -0.646493},
    {0.641987, -0.721270},
    {0.551769, -0.783284},
    {0.445510, -0.833114},
    {0.329305, -0.864279},
    {0.218421, -0.872712},
    {0.125633, -0.866132},
    {0.051269, -0.853187},
    {-0.000552, -0.841042},
    {-0.024194, -0.836835},
    {-0.022717, -0.840772},
    {0.000135, -0.850379},
    {0.042589, -0.861882},
    {0.110093, -0.872994},
    {0.196654, -0.876263},
    {0.294397, -0.867384},
    {0.399265, -0.842877},
    {0.509398, -0.798959},
    {0.614847, -0.737482},
    {0.707361, -0.664294},
    {0.790178, -0.577929},
};

}  // namespace jacket::demo::accuracy
