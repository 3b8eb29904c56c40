#pragma once
#include <array>

/// Reference figures of the accuracy problems; tests/data/ holds the tables that they are taken from.
namespace jacket::demo::accuracy {

/// Tip of a horizontal clamped strip under its own weight; Gamma = rho g t L^3 / D, nu = 0. Elastica, integrated.
struct HeavyTip {
    double gamma, x, drop;  ///< x, drop: in lengths of the strip
};
inline constexpr std::array<HeavyTip, 5> kHeavyTips{{{1, 0.99124640, 0.12347140},
                                                     {3, 0.93151121, 0.33964839},
                                                     {10, 0.65635376, 0.70019972},
                                                     {30, 0.34276368, 0.87309242},
                                                     {100, 0.15922338, 0.93752394}}};

/// Tip of a cantilever under a dead force across its end, of size P L^2 / EI. Inextensible elastica; the nonlinear
/// shell benchmark 3.1 of Sze, Liu, Lo 2004 is its largest load.
struct LoadedTip {
    double load, x, drop;  ///< x, drop: in lengths of the strip
};
inline constexpr std::array<LoadedTip, 2> kLoadedTips{{{1, 0.94356676, 0.30172077}, {4, 0.67105876, 0.66996418}}};

/// Catenary of length L between two supports on one height.
struct HangingCurve {
    double span, sag;  ///< in lengths of the curve
};
inline constexpr std::array<HangingCurve, 2> kCatenaries{{{0.9, 0.190709}, {0.8, 0.26543751}}};

/// Deflection at the centre of a square thin plate: w = alpha q a^4 / D (uniform load), beta P a^2 / D (centre load).
struct PlateDeflection {
    double uniform, centre;
};
inline constexpr PlateDeflection kSupportedPlate{0.004062352660675012, 0.011600839520246537};  // Navier's series
inline constexpr PlateDeflection kClampedPlate{0.0012653190758182456, 0.005612029669611215};   // Ritz, extrapolated

/// First five elastic frequencies of a square plate, lambda = omega a^2 sqrt(rho t / D). Ritz.
struct PlateFrequencies {
    double poisson;
    std::array<double, 5> free, cantilever;
};
inline constexpr std::array<PlateFrequencies, 2> kPlateFrequencies{
    {{0.0, {15.82263, 22.37329, 22.37329, 38.69431, 38.69431}, {3.51602, 9.6757, 22.03449, 28.34653, 33.70256}},
     {0.3, {13.4682, 19.59614, 24.2702, 34.80089, 34.80089}, {3.47104, 8.50652, 21.28457, 27.19882, 30.95552}}}};

/// Gamma = rho g t L^3 / D at which a cantilever on edge, b / L = 1/4, buckles sideways under its own weight. Ritz.
struct CriticalWeight {
    double poisson, gamma;
};
inline constexpr std::array<CriticalWeight, 2> kLateralBuckling{{{0.0, 21.326141538960904}, {0.3, 17.718696186938047}}};

/// Out-of-plane frequencies of a sheet that hangs from its upper edge: half the zeros of J0, omega sqrt(L / g).
inline constexpr std::array<double, 3> kHangingFrequencies{1.2024127788478864, 2.7600390551431553, 4.326863956455506};

/// Scordelis-Lo roof: vertical displacement of the free edge's middle, Kirchhoff-Love shell (isogeometric: PENGoLINS).
/// 0.3024 (MacNeal and Harder 1985) is for shear-flexible shells.
inline constexpr double kScordelisLo = 0.3006;
/// Pinched hemisphere with a hole of 18 degrees: displacement under each load; 0.093 to 0.094 in the literature.
inline constexpr double kHemisphere = 0.0935;

/// Hinged cylindrical roof of thickness 12.7 under a central load: load over 3000 at two central deflections, at the
/// limit point and in the valley behind it. Sze, Liu, Lo, Finite Elem. Anal. Des. 40 (2004), problem 3.8a there.
struct SnapThrough {
    double deflection, load;
};
inline constexpr SnapThrough kRoofLimit{11.293, 0.7421}, kRoofValley{19.852, 0.1729};

}  // namespace jacket::demo::accuracy
