#pragma once

/// Where the tip of the heavy strip of Motion.cpp is, 30 times a second: x, y [m] from the clamp. With patch bending on
/// 80 x 20 cells with alternating diagonals, BDF2 with every step solved to the end by Newton's method, step 1/960 s,
/// tolerance 1e-5. One linear solve a step, at 1/4800 s, comes within 0.001 of it.
namespace jacket::demo::accuracy {

inline constexpr double kStripSeconds = 1.0;
inline constexpr int kStripRate = 30;  ///< samples per second
inline constexpr const char* kStripSource = "80 x 20 cells, BDF2 solved to the end, step 1/960 s";

inline constexpr double kStripTip[][2] = {
    {0.999947, -0.005474},  {0.999387, -0.020094},  {0.997400, -0.047904},  {0.993398, -0.100241},
    {0.983189, -0.175954},  {0.960223, -0.268151},  {0.918393, -0.372518},  {0.860462, -0.473683},
    {0.795954, -0.563184},  {0.723052, -0.646709},  {0.641805, -0.721442},  {0.551527, -0.783476},
    {0.445333, -0.833268},  {0.328866, -0.864454},  {0.217556, -0.872737},  {0.124774, -0.865995},
    {0.050121, -0.852804},  {-0.001772, -0.840605}, {-0.025655, -0.836300}, {-0.023900, -0.840503},
    {-0.001000, -0.850241}, {0.041399, -0.861845},  {0.108967, -0.873072},  {0.195682, -0.876358},
    {0.293770, -0.867510},  {0.398421, -0.843055},  {0.509103, -0.799077},  {0.615042, -0.737317},
    {0.707848, -0.663927},  {0.790952, -0.577204},
};

}  // namespace jacket::demo::accuracy
