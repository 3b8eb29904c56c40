#include "jacket/Material.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <limits>
#include <numeric>
#include <sstream>
#include <string>
#include <vector>

#include "jacket/models/StencilTools.h"

namespace jacket {

double ShellMaterial::stretchStiffness() const {
    return stretchStiffnessOverride.value_or(young * thickness);
}

double ShellMaterial::bendingStiffness() const {
    return bendingStiffnessOverride.value_or(young * thickness * thickness * thickness /
                                             (12.0 * (1.0 - poisson * poisson)));
}

double ShellMaterial::areaDensity() const {
    return areaDensityOverride.value_or(density * thickness);
}

double ShellMaterial::yieldCurvature() const {
    const double stiffness = bendingStiffness();
    if (!yieldStress || stiffness == 0.0) return std::numeric_limits<double>::infinity();
    return *yieldStress * thickness * thickness / (6.0 * stiffness);
}

namespace {

void requirePositive(double value, std::string_view field) {
    requireParameter(value > 0.0, field, "> 0", value);
    requireParameter(std::isfinite(value), field, "finite", value);
}

void requireNotNegative(double value, std::string_view field) {
    requireParameter(value >= 0.0, field, ">= 0", value);
    requireParameter(std::isfinite(value), field, "finite", value);
}

void validateOrthotropy(const ShellMaterial& m) {
    const ShellMaterial::Orthotropy& o = *m.orthotropy;
    requirePositive(o.weftYoung, "ShellMaterial.orthotropy.weftYoung [Pa]");
    requirePositive(o.shear, "ShellMaterial.orthotropy.shear [Pa]");
    requirePositive(o.warpDirection.norm(), "ShellMaterial.orthotropy.warpDirection's length [-]");
    // else some pair of stretches along warp and weft would release energy
    const double limit = m.stretchStiffness() / (m.poisson * m.poisson * m.thickness);  // infinite for nu = 0
    if (o.weftYoung < limit) return;
    std::ostringstream rule;
    rule << "< E_1 / nu_12^2 = " << limit << " (positive definite stiffness)";
    requireParameter(false, "ShellMaterial.orthotropy.weftYoung [Pa]", rule.str(), o.weftYoung);
}

}  // namespace

void validate(const ShellMaterial& m) {
    requirePositive(m.young, "ShellMaterial.young [Pa]");
    requireParameter(m.poisson > -1.0 && m.poisson <= 0.5, "ShellMaterial.poisson [-]", "> -1 and <= 0.5", m.poisson);
    requirePositive(m.thickness, "ShellMaterial.thickness [m]");
    requirePositive(m.density, "ShellMaterial.density [kg/m^3]");
    if (m.stretchStiffnessOverride)
        requirePositive(*m.stretchStiffnessOverride, "ShellMaterial.stretchStiffnessOverride [N/m]");
    if (m.bendingStiffnessOverride)
        requireNotNegative(*m.bendingStiffnessOverride, "ShellMaterial.bendingStiffnessOverride [N m]");
    if (m.areaDensityOverride) requirePositive(*m.areaDensityOverride, "ShellMaterial.areaDensityOverride [kg/m^2]");
    if (m.yieldStress) requirePositive(*m.yieldStress, "ShellMaterial.yieldStress [Pa]");
    requireNotNegative(m.hardening, "ShellMaterial.hardening [Pa]");
    if (m.orthotropy) validateOrthotropy(m);
    requireNotNegative(m.stiffnessDamping, "ShellMaterial.stiffnessDamping [s]");
    requireNotNegative(m.massDamping, "ShellMaterial.massDamping [1/s]");
}

namespace materials {
namespace {

ShellMaterial solid(double young, double poisson, double density, double thickness) {
    ShellMaterial m;
    m.young = young;
    m.poisson = poisson;
    m.thickness = thickness;
    m.density = density;
    return m;
}

struct FabricData {
    double thickness;         ///< under a light load [m]
    double areaDensity;       ///< [kg/m^2]
    double stretchStiffness;  ///< E t [N/m], mean slope up to about 500 N/m, warp and weft averaged
    double bendingStiffness;  ///< D [N m]; 1 gf cm^2/cm = 9.81e-5 N m
};

/// Young's modulus and density are set to agree with the measured values; Poisson's ratio is roughly a plain weave's.
ShellMaterial fabric(const FabricData& data, double thickness) {
    ShellMaterial m = solid(data.stretchStiffness / thickness, 0.2, data.areaDensity / thickness, thickness);
    m.stretchStiffnessOverride = data.stretchStiffness;
    m.bendingStiffnessOverride = data.bendingStiffness;
    m.areaDensityOverride = data.areaDensity;
    return m;
}

// Order of magnitude and range after the KES-F figures of apparel fabrics: extension at 500 gf/cm (490 N/m), bending
// rigidity B, weight W.
constexpr FabricData kCotton{0.4e-3, 0.12, 1.0e4, 5e-6};  // shirting: 5 %, B 0.05 gf cm^2/cm, W 120 g/m^2
constexpr FabricData kDenim{0.9e-3, 0.40, 1.5e4, 5e-5};   // 12 oz: 3 %, B 0.5 gf cm^2/cm, W 400 g/m^2
constexpr FabricData kSilk{0.2e-3, 0.07, 1.0e4, 2e-6};    // dress silk: 5 %, B 0.02 gf cm^2/cm, W 70 g/m^2

constexpr std::string_view kFabricSource =
    "typical of the KES-F ranges in Kawabata, The Standardization and Analysis of Hand Evaluation, 2nd ed. 1980, and "
    "Hu, "
    "Structure and Mechanics of Woven Fabrics, 2004";
constexpr std::string_view kAshbySource =
    "within the ranges of Ashby, Materials Selection in Mechanical Design, appendix A";
constexpr std::string_view kMetalSource =
    "Gere and Goodno, Mechanics of Materials, appendix on properties of materials";

constexpr std::array<Preset, 11> kPresets{{
    {"cotton", kCotton.thickness, [](double t) { return fabric(kCotton, t); }, kFabricSource},
    {"denim", kDenim.thickness, [](double t) { return fabric(kDenim, t); }, kFabricSource},
    {"silk", kSilk.thickness, [](double t) { return fabric(kSilk, t); }, kFabricSource},
    {"leather", 1.5e-3, leather, kAshbySource},
    {"paper", 1e-4, paper,
     "office paper of 80 g/m^2; modulus between the two directions of machine-made sheets, "
     "Niskanen (ed.), Paper Physics, 2nd ed. 2008"},
    {"cardboard", 5e-4, cardboard, kAshbySource},
    {"rubber", 1e-3, rubber,
     "natural rubber, small strains; within the ranges of Ashby, Materials Selection in "
     "Mechanical Design, appendix A"},
    {"aluminium", 1e-3, aluminium, kMetalSource},
    {"steel", 1e-3, steel, kMetalSource},
    {"copper", 1e-3, copper, kMetalSource},
    {"PET", 1e-4, pet, kAshbySource},
}};

std::string lowerCase(std::string_view text) {
    std::string result(text);
    for (char& c : result) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return result;
}

/// Insertions, deletions and replacements between two words (Levenshtein).
std::size_t editDistance(std::string_view a, std::string_view b) {
    std::vector<std::size_t> row(b.size() + 1);  // distances of a's first i letters to each beginning of b
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 0; i < a.size(); ++i) {
        std::size_t diagonal = row[0];
        row[0] = i + 1;
        for (std::size_t j = 0; j < b.size(); ++j) {
            const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
            diagonal = row[j + 1];
            row[j + 1] = std::min({replaced, row[j + 1] + 1, row[j] + 1});
        }
    }
    return row.back();
}

}  // namespace

ShellMaterial cotton() {
    return fabric(kCotton, kCotton.thickness);
}
ShellMaterial denim() {
    return fabric(kDenim, kDenim.thickness);
}
ShellMaterial silk() {
    return fabric(kSilk, kSilk.thickness);
}
ShellMaterial leather(double thickness) {
    return solid(0.15e9, 0.4, 900.0, thickness);
}
ShellMaterial paper(double thickness) {
    return solid(4e9, 0.3, 800.0, thickness);
}
ShellMaterial cardboard(double thickness) {
    return solid(3e9, 0.3, 700.0, thickness);
}
ShellMaterial rubber(double thickness) {
    return solid(2e6, 0.5, 925.0, thickness);
}
ShellMaterial aluminium(double thickness) {
    return solid(70e9, 0.33, 2700.0, thickness);
}
ShellMaterial steel(double thickness) {
    return solid(200e9, 0.30, 7850.0, thickness);
}
ShellMaterial copper(double thickness) {
    return solid(115e9, 0.34, 8900.0, thickness);
}
ShellMaterial pet(double thickness) {
    return solid(3.5e9, 0.38, 1380.0, thickness);
}

std::span<const Preset> presets() {
    return kPresets;
}

ShellMaterial byName(std::string_view name) {
    const std::string wanted = lowerCase(name);
    const auto distance = [&](const Preset& preset) { return editDistance(wanted, lowerCase(preset.name)); };
    const Preset& nearest = *std::ranges::min_element(kPresets, {}, distance);
    if (distance(nearest) == 0) return nearest.make(nearest.usualThickness);
    throw std::invalid_argument("unknown material \"" + std::string(name) + "\"; did you mean \"" +
                                std::string(nearest.name) + "\"?");
}

}  // namespace materials
}  // namespace jacket
