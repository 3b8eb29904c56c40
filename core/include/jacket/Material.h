#pragma once
#include <optional>
#include <span>
#include <string_view>

#include "jacket/Types.h"

namespace jacket {

/// What a caller says about a sheet's material. SI units. Isotropic unless `orthotropy` is set.
struct ShellMaterial {
    double young = 1e7;    ///< Young's modulus E [Pa], > 0; of an orthotropic sheet the warp's
    double poisson = 0.3;  ///< Poisson's ratio nu [-], -1 < nu <= 0.5 (a sheet in plane stress may be incompressible);
                           ///< of an orthotropic sheet nu_12, the weft's contraction when the warp is pulled
    double thickness = 1e-3;  ///< t [m], > 0
    double density = 1000.0;  ///< rho [kg/m^3], > 0

    /// Measured values of fabrics, whose yarns make the formulas for a solid sheet too stiff. Each replaces what would
    /// follow from the four numbers above.
    std::optional<double> stretchStiffnessOverride{};  ///< E t [N/m], > 0
    std::optional<double> bendingStiffnessOverride{};  ///< D [N m], >= 0
    std::optional<double> areaDensityOverride{};       ///< rho t [kg/m^2], > 0

    std::optional<double> yieldStress{};  ///< sigma_y [Pa], > 0; unset: never yields
    double hardening = 0.0;               ///< H, slope of yield stress over accumulated plastic strain [Pa], >= 0

    /// Two directions at right angles with moduli of their own: warp and weft, or a paper machine's and across it.
    /// Stretching and shearing only: bending stays isotropic, with D from `young` and `poisson` or measured. Positive
    /// definite: nu_12^2 (E_2 t) / (E_1 t) < 1.
    struct Orthotropy {
        double weftYoung = 1e7;             ///< E_2 [Pa], > 0; times `thickness`, whatever the overrides say
        double shear = 4e6;                 ///< in-plane shear modulus G [Pa], > 0; times `thickness` likewise
        Vec3 warpDirection{1.0, 0.0, 0.0};  ///< in the rest shape; projected into every triangle, so normal to none [-]
    };
    std::optional<Orthotropy> orthotropy{};

    double stiffnessDamping = 0.0;  ///< beta [s], >= 0: damping force -beta K v
    double massDamping = 0.0;       ///< alpha [1/s], >= 0: damping force -alpha M v

    double stretchStiffness() const;  ///< E t [N/m]
    double bendingStiffness() const;  ///< D = E t^3 / (12 (1 - nu^2)) [N m]
    double areaDensity() const;       ///< rho t [kg/m^2]

    /// e_y [1/m], the curvature at which the moment D e reaches sigma_y t^2 / 6 and the outermost fibre yields:
    /// 2 sigma_y (1 - nu^2) / (E t), unless D is overridden. Infinite where nothing yields, or nothing resists bending.
    double yieldCurvature() const;
};

/// Throws std::invalid_argument naming field, value and rule, e.g. "ShellMaterial.thickness [m] must be > 0, got
/// -0.001".
void validate(const ShellMaterial& material);

/// Textbook materials. `thickness` [m] is of the sheet; unset: the usual one. What has no yield stress has none that
/// means something: rubber springs back until it tears, leather and woven cloth keep creases by fibres that slip.
namespace materials {
ShellMaterial cotton();
ShellMaterial denim();
ShellMaterial silk();
ShellMaterial leather(std::optional<double> thickness = {});
ShellMaterial paper(std::optional<double> thickness = {});
ShellMaterial cardboard(std::optional<double> thickness = {});
ShellMaterial rubber(std::optional<double> thickness = {});
ShellMaterial aluminium(double thickness);
ShellMaterial steel(double thickness);
ShellMaterial copper(double thickness);
ShellMaterial pet(std::optional<double> thickness = {});

/// One line of the table of presets.
struct Preset {
    std::string_view name;
    ShellMaterial usual;      ///< at its usual thickness
    std::string_view source;  ///< where the figures come from

    /// At another thickness [m]. What was measured of a fabric stays, and its modulus and density follow.
    ShellMaterial make(double thickness) const;
};
std::span<const Preset> presets();
ShellMaterial byName(
    std::string_view name);  ///< at its usual thickness; throws std::invalid_argument with the nearest name
}  // namespace materials

}  // namespace jacket
