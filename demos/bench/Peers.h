#pragma once
#include <array>

/// Figures of other solvers on the scene drape, kept to be shown beside ours; see tests/bench/README.md.
namespace jacket::demo::bench {

/// CPU ms of a frame of 1/60 s on one core, and in brackets the strain of edges in per cent: largest at the end / 99th
/// percentile at the end / peak. "-": not measured.
struct PeerRow {
    int n;  ///< vertices along each side
    const char *softBody, *jolt20, *jolt80, *jolt320, *mujoco, *arcsim;
};

/// Measured once, on another day than whatever stands beside them; Jolt with 20, 80 and 320 iterations, MuJoCo's
/// elastic2d, btSoftBody with 10 iterations.
inline constexpr std::array kPeers{
    PeerRow{11, "0.13", "0.37 [1.1/0.6/2.5]", "1.5 [0.6/0.5/1.8]", "-", "2.3", "22"},
    PeerRow{31, "0.7-1.3 [41/18/67]", "3.4 [4.1/1.1/10]", "13.7 [1.1/0.5/3.7]", "55 [0.5/0.3/2.4]", "23 [1.6/0.4/11]",
            "45"},
    PeerRow{71, "8.5", "19 [57/11/140]", "76 [3.0/0.4/8.9]", "308 [0.4/0.1/3.4]", "152 [2.1/0.3/17]", "270-317"},
    PeerRow{101, "17-22 [309/182/537]", "40 [109/19/156]", "158 [5.9/0.6/19]", "645 [0.5/0.1/3.5]", "161-293",
            "620-715"},
    PeerRow{201, "-", "exploded", "NaN", "2720", "-", "-"}};

}  // namespace jacket::demo::bench
