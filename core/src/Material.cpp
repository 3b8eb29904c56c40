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

struct Fabric {
    double thickness;         ///< under a light load [m]
    double areaDensity;       ///< [kg/m^2]
    double stretchStiffness;  ///< E t [N/m], mean slope up to about 500 N/m, warp and weft averaged
    double bendingStiffness;  ///< D [N m]; 1 gf cm^2/cm = 9.81e-5 N m
};

/// Young's modulus and density are set to agree with the measured values; Poisson's ratio is roughly a plain weave's.
/// Isotropic, so that a sheet of any shape may be cut from it. Real weaves shear far more easily: denim has a G t of 85
/// to 190 N/m (1.5 to 3.4 gf/cm per degree, Journal of Textiles 2016, 4614168), which `orthotropy` can say once the
/// direction of the warp is known.
ShellMaterial measured(const Fabric& fabric) {
    ShellMaterial m{.young = fabric.stretchStiffness / fabric.thickness,
                    .poisson = 0.2,
                    .thickness = fabric.thickness,
                    .density = fabric.areaDensity / fabric.thickness};
    m.stretchStiffnessOverride = fabric.stretchStiffness;
    m.bendingStiffnessOverride = fabric.bendingStiffness;
    m.areaDensityOverride = fabric.areaDensity;
    return m;
}

// Order of magnitude and range after the KES-F figures of apparel fabrics: extension at 500 gf/cm (490 N/m), bending
// rigidity B, weight W.
constexpr std::string_view kFabricSource =
    "typical of the KES-F ranges in Kawabata, The Standardization and Analysis of Hand Evaluation, 2nd ed. 1980, and "
    "Hu, Structure and Mechanics of Woven Fabrics, 2004";

// Hardening is the mean slope of true stress over plastic strain, from yield to the tensile strength R_m at the strain
// there: (R_m exp(e) - sigma_y) / e. A sheet bent by a few per cent hardens faster than that at first.
const std::array<Preset, 11>& table() {
    static const std::array<Preset, 11> presets{{
        // shirting: 5 %, B 0.05 gf cm^2/cm, 120 g/m^2
        {"cotton", measured({0.4e-3, 0.12, 1.0e4, 5e-6}), kFabricSource},
        // 12 oz: 3 %, B 0.5 gf cm^2/cm, 400 g/m^2
        {"denim", measured({0.9e-3, 0.40, 1.5e4, 5e-5}), kFabricSource},
        // dress silk: 5 %, B 0.02 gf cm^2/cm, 70 g/m^2
        {"silk", measured({0.2e-3, 0.07, 1.0e4, 2e-6}), kFabricSource},
        {"leather",
         {.young = 0.15e9, .poisson = 0.4, .thickness = 1.5e-3, .density = 900.0},
         "within the ranges of Ashby, Materials Selection in Mechanical Design, appendix A"},
        {"paper",
         {.young = 4e9,
          .poisson = 0.3,
          .thickness = 1e-4,
          .density = 800.0,
          .yieldStress = 15e6,  // leaves the line at a strain of about 0.4 %
          .hardening = 0.8e9},  // some 32 MPa at a strain of 3 %
         "office paper of 80 g/m^2; modulus, yield and hardening between the two directions of machine-made sheets, "
         "Niskanen (ed.), Paper Physics, 2nd ed. 2008; yield and hardening are estimates"},
        {"cardboard",
         {.young = 3e9, .poisson = 0.3, .thickness = 5e-4, .density = 700.0, .yieldStress = 9e6, .hardening = 1e9},
         "solid board; within the ranges of Ashby, Materials Selection in Mechanical Design, appendix A; yield and "
         "hardening estimated, between those along and across the machine's direction"},
        {"rubber",
         {.young = 2e6, .poisson = 0.5, .thickness = 1e-3, .density = 925.0},
         "natural rubber, small strains; within the ranges of Ashby, Materials Selection in Mechanical Design, "
         "appendix A"},
        {"aluminium",
         {.young = 70e9,
          .poisson = 0.33,
          .thickness = 1e-3,
          .density = 2700.0,
          .yieldStress = 193e6,
          .hardening = 0.55e9},  // R_m 228 MPa, 12 % at break
         "Gere and Goodno, Mechanics of Materials, appendix on properties of materials; yield and hardening of "
         "5052-H32 sheet, ASM Aerospace Specification Metals (asm.matweb.com), typical"},
        {"steel",
         {.young = 200e9,
          .poisson = 0.30,
          .thickness = 1e-3,
          .density = 7850.0,
          .yieldStress = 180e6,
          .hardening = 1.05e9},  // R_m 310 MPa, n = 0.18 the strain there
         "Gere and Goodno, Mechanics of Materials, appendix on properties of materials; yield and hardening of "
         "cold-rolled DC04, within EN 10130 (R_e at most 210 MPa, R_m 270 to 350 MPa, n at least 0.18)"},
        {"copper",
         {.young = 115e9,
          .poisson = 0.34,
          .thickness = 1e-3,
          .density = 8900.0,
          .yieldStress = 75e6,
          .hardening = 0.64e9},  // R_m 220 MPa, 48 % at break
         "Gere and Goodno, Mechanics of Materials, appendix on properties of materials; yield and hardening of "
         "annealed C10800 (OS050), makeitfrom.com"},
        {"PET",
         {.young = 4.9e9,
          .poisson = 0.38,
          .thickness = 1e-4,
          .density = 1390.0,
          .yieldStress = 90e6,   // the line below, back to where it meets E: at 5 % the stress is 98 MPa
          .hardening = 0.45e9},  // R_m 200 to 235 MPa, 116 to 91 % at break
         "biaxially drawn film, DuPont Teijin Films, Mylar product information H-37232 (92A)"},
    }};
    return presets;
}

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

const Preset& find(std::string_view name) {
    const std::string wanted = lowerCase(name);
    const auto distance = [&](const Preset& preset) { return editDistance(wanted, lowerCase(preset.name)); };
    const Preset& nearest = *std::ranges::min_element(table(), {}, distance);
    if (distance(nearest) == 0) return nearest;
    throw std::invalid_argument("unknown material \"" + std::string(name) + "\"; did you mean \"" +
                                std::string(nearest.name) + "\"?");
}

ShellMaterial at(std::optional<double> thickness, std::string_view name) {
    const Preset& preset = find(name);
    return thickness ? preset.make(*thickness) : preset.usual;
}

}  // namespace

ShellMaterial Preset::make(double thickness) const {
    ShellMaterial m = usual;
    m.thickness = thickness;
    if (m.stretchStiffnessOverride) m.young = *m.stretchStiffnessOverride / thickness;
    if (m.areaDensityOverride) m.density = *m.areaDensityOverride / thickness;
    return m;
}

std::span<const Preset> presets() {
    return table();
}

ShellMaterial byName(std::string_view name) {
    return find(name).usual;
}

ShellMaterial cotton() {
    return byName("cotton");
}
ShellMaterial denim() {
    return byName("denim");
}
ShellMaterial silk() {
    return byName("silk");
}
ShellMaterial leather(std::optional<double> thickness) {
    return at(thickness, "leather");
}
ShellMaterial paper(std::optional<double> thickness) {
    return at(thickness, "paper");
}
ShellMaterial cardboard(std::optional<double> thickness) {
    return at(thickness, "cardboard");
}
ShellMaterial rubber(std::optional<double> thickness) {
    return at(thickness, "rubber");
}
ShellMaterial aluminium(double thickness) {
    return at(thickness, "aluminium");
}
ShellMaterial steel(double thickness) {
    return at(thickness, "steel");
}
ShellMaterial copper(double thickness) {
    return at(thickness, "copper");
}
ShellMaterial pet(std::optional<double> thickness) {
    return at(thickness, "PET");
}

}  // namespace materials
}  // namespace jacket
