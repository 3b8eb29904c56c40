#include "jacket/Material.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace jacket {
namespace {

/// The default material with one field changed.
template <class Field>
ShellMaterial with(Field ShellMaterial::*field, double value) {
    ShellMaterial m;
    m.*field = value;
    return m;
}

/// What validate() says about a material, or "" when it is content.
std::string complaint(const ShellMaterial& material) {
    try {
        validate(material);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "";
}

std::string lookUpComplaint(std::string_view name) {
    try {
        materials::byName(name);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "";
}

TEST(ShellMaterialTest, StiffnessesFollowThePlate) {
    ShellMaterial m;
    m.young = 2e11;
    m.poisson = 0.3;
    m.thickness = 1e-3;
    m.density = 7850.0;
    EXPECT_DOUBLE_EQ(m.stretchStiffness(), 2e8);
    EXPECT_NEAR(m.bendingStiffness(), 18.315, 1e-3);  // E t^3 / (12 (1 - nu^2)) [N m]
    EXPECT_DOUBLE_EQ(m.areaDensity(), 7.85);
}

TEST(ShellMaterialTest, OverridesReplaceWhatWouldFollow) {
    ShellMaterial m;
    m.stretchStiffnessOverride = 123.0;
    m.bendingStiffnessOverride = 0.0;
    m.areaDensityOverride = 0.2;
    EXPECT_EQ(m.stretchStiffness(), 123.0);
    EXPECT_EQ(m.bendingStiffness(), 0.0);
    EXPECT_EQ(m.areaDensity(), 0.2);
    EXPECT_EQ(complaint(m), "");
}

TEST(ShellMaterialTest, ValidationNamesFieldRuleAndValue) {
    EXPECT_EQ(complaint({}), "");
    EXPECT_EQ(complaint(with(&ShellMaterial::young, 0.0)), "ShellMaterial.young [Pa] must be > 0, got 0");
    EXPECT_EQ(complaint(with(&ShellMaterial::thickness, -0.001)),
              "ShellMaterial.thickness [m] must be > 0, got -0.001");
    EXPECT_EQ(complaint(with(&ShellMaterial::density, -2.0)), "ShellMaterial.density [kg/m^3] must be > 0, got -2");
    EXPECT_EQ(complaint(with(&ShellMaterial::poisson, 0.7)),
              "ShellMaterial.poisson [-] must be > -1 and <= 0.5, got 0.7");
    EXPECT_EQ(complaint(with(&ShellMaterial::poisson, -1.0)),
              "ShellMaterial.poisson [-] must be > -1 and <= 0.5, got -1");
    EXPECT_EQ(complaint(with(&ShellMaterial::poisson, 0.5)), "");
    EXPECT_EQ(complaint(with(&ShellMaterial::stretchStiffnessOverride, 0.0)),
              "ShellMaterial.stretchStiffnessOverride [N/m] must be > 0, got 0");
    EXPECT_EQ(complaint(with(&ShellMaterial::bendingStiffnessOverride, -1.0)),
              "ShellMaterial.bendingStiffnessOverride [N m] must be >= 0, got -1");
    EXPECT_EQ(complaint(with(&ShellMaterial::areaDensityOverride, 0.0)),
              "ShellMaterial.areaDensityOverride [kg/m^2] must be > 0, got 0");
    EXPECT_EQ(complaint(with(&ShellMaterial::stiffnessDamping, -1.0)),
              "ShellMaterial.stiffnessDamping [s] must be >= 0, got -1");
    EXPECT_EQ(complaint(with(&ShellMaterial::massDamping, -1.0)),
              "ShellMaterial.massDamping [1/s] must be >= 0, got -1");
}

TEST(ShellMaterialTest, YieldCurvatureIsWhereTheOutermostFibreYields) {
    ShellMaterial m;
    m.young = 2e11;
    m.poisson = 0.3;
    m.thickness = 1e-3;
    EXPECT_TRUE(std::isinf(m.yieldCurvature()));  // never yields
    m.yieldStress = 2.5e8;
    EXPECT_NEAR(m.yieldCurvature(), 2.0 * 2.5e8 * (1.0 - 0.09) / (2e11 * 1e-3), 1e-12);
    // twice as stiff in bending: the same moment, half the curvature
    m.bendingStiffnessOverride = 2.0 * m.bendingStiffness();
    EXPECT_NEAR(m.yieldCurvature(), 2.5e8 * (1.0 - 0.09) / (2e11 * 1e-3), 1e-12);
    m.bendingStiffnessOverride = 0.0;  // no moment, however far it is bent
    EXPECT_TRUE(std::isinf(m.yieldCurvature()));
}

TEST(ShellMaterialTest, YieldAndHardeningAreChecked) {
    ShellMaterial m;
    m.yieldStress = 1e6;
    m.hardening = 1e5;
    EXPECT_EQ(complaint(m), "");
    m.yieldStress = 0.0;
    EXPECT_EQ(complaint(m), "ShellMaterial.yieldStress [Pa] must be > 0, got 0");
    m.yieldStress = std::numeric_limits<double>::infinity();
    EXPECT_EQ(complaint(m), "ShellMaterial.yieldStress [Pa] must be finite, got inf");
    EXPECT_EQ(complaint(with(&ShellMaterial::hardening, -1.0)), "ShellMaterial.hardening [Pa] must be >= 0, got -1");
}

TEST(ShellMaterialTest, OrthotropyMustBePositiveDefinite) {
    const auto orthotropic = [](double weft, double shear, const Vec3& warp = Vec3(1, 0, 0)) {
        ShellMaterial m;  // E_1 = 10 MPa
        m.poisson = 0.4;
        m.orthotropy = ShellMaterial::Orthotropy{weft, shear, warp};
        return m;
    };
    EXPECT_EQ(complaint(orthotropic(6.2e7, 1e5)), "");
    EXPECT_EQ(complaint(orthotropic(6.3e7, 1e5)),
              "ShellMaterial.orthotropy.weftYoung [Pa] must be < E_1 / nu_12^2 = 6.25e+07 (positive definite "
              "stiffness), got 6.3e+07");
    EXPECT_EQ(complaint(orthotropic(0.0, 1e5)), "ShellMaterial.orthotropy.weftYoung [Pa] must be > 0, got 0");
    EXPECT_EQ(complaint(orthotropic(1e7, -3.0)), "ShellMaterial.orthotropy.shear [Pa] must be > 0, got -3");
    EXPECT_EQ(complaint(orthotropic(1e7, 1e6, Vec3::Zero())),
              "ShellMaterial.orthotropy.warpDirection's length [-] must be > 0, got 0");
    ShellMaterial halved = orthotropic(6.2e7, 1e5);
    halved.stretchStiffnessOverride = 0.5 * halved.stretchStiffness();  // what counts is E_1 t
    EXPECT_NE(complaint(halved), "");
    ShellMaterial uncoupled = orthotropic(1e12, 1e5);
    uncoupled.poisson = 0.0;
    EXPECT_EQ(complaint(uncoupled), "");
}

TEST(ShellMaterialTest, NotANumberAndInfinityAreRefused) {
    const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
    EXPECT_EQ(complaint(with(&ShellMaterial::young, nan)), "ShellMaterial.young [Pa] must be > 0, got nan");
    EXPECT_EQ(complaint(with(&ShellMaterial::young, inf)), "ShellMaterial.young [Pa] must be finite, got inf");
    for (const double bad : {nan, inf}) {
        EXPECT_NE(complaint(with(&ShellMaterial::poisson, bad)), "");
        EXPECT_NE(complaint(with(&ShellMaterial::thickness, bad)), "");
        EXPECT_NE(complaint(with(&ShellMaterial::density, bad)), "");
        EXPECT_NE(complaint(with(&ShellMaterial::stretchStiffnessOverride, bad)), "");
        EXPECT_NE(complaint(with(&ShellMaterial::bendingStiffnessOverride, bad)), "");
        EXPECT_NE(complaint(with(&ShellMaterial::areaDensityOverride, bad)), "");
        EXPECT_NE(complaint(with(&ShellMaterial::stiffnessDamping, bad)), "");
        EXPECT_NE(complaint(with(&ShellMaterial::massDamping, bad)), "");
    }
}

TEST(MaterialPresetTest, AllAreValidAndFoundByTheirNames) {
    EXPECT_EQ(materials::presets().size(), 11u);
    for (const auto& preset : materials::presets()) {
        const ShellMaterial m = materials::byName(preset.name);
        EXPECT_EQ(complaint(m), "") << preset.name;
        EXPECT_EQ(m.thickness, preset.usual.thickness) << preset.name;
        EXPECT_EQ(preset.make(2e-3).thickness, 2e-3) << preset.name;
        EXPECT_FALSE(preset.source.empty()) << preset.name;
    }
    EXPECT_EQ(materials::byName("Steel").young, materials::steel(1e-3).young);
    EXPECT_EQ(materials::byName("pet").density, materials::pet().density);
}

TEST(MaterialPresetTest, ThinnerSheetsAreOfTheSameStuff) {
    const ShellMaterial foil = materials::aluminium(2e-5), plate = materials::aluminium(4e-3);
    EXPECT_EQ(foil.young, plate.young);
    EXPECT_EQ(foil.yieldStress, plate.yieldStress);
    EXPECT_EQ(foil.thickness, 2e-5);
    EXPECT_EQ(materials::leather().thickness, 1.5e-3);
    EXPECT_EQ(materials::leather(3e-3).thickness, 3e-3);
}

// Mild steel sheet of 1 mm stays bent when rolled to less than a radius of 0.6 m, paper to less than 15 mm.
TEST(MaterialPresetTest, MetalsPaperAndPlasticYieldAndTheOthersDoNot) {
    for (const char* name : {"aluminium", "steel", "copper", "PET", "paper", "cardboard"}) {
        const ShellMaterial m = materials::byName(name);
        ASSERT_TRUE(m.yieldStress) << name;
        EXPECT_GT(*m.yieldStress / m.young, 1e-4) << name;  // strains of yield
        EXPECT_LT(*m.yieldStress / m.young, 2e-2) << name;
        EXPECT_GT(m.hardening, 0.0) << name;
        EXPECT_LT(m.hardening, m.young) << name;
    }
    for (const char* name : {"cotton", "denim", "silk", "leather", "rubber"})
        EXPECT_FALSE(materials::byName(name).yieldStress) << name;
    EXPECT_NEAR(1.0 / materials::steel(1e-3).yieldCurvature(), 0.61, 0.01);
    EXPECT_NEAR(1.0 / materials::paper().yieldCurvature(), 0.0147, 1e-4);
}

TEST(MaterialPresetTest, FabricsBendMoreEasilyThanASolidSheetWould) {
    for (const auto& m : {materials::cotton(), materials::denim(), materials::silk()}) {
        const double solid = m.stretchStiffness() * m.thickness * m.thickness / (12.0 * (1.0 - m.poisson * m.poisson));
        EXPECT_LT(m.bendingStiffness(), solid);
        EXPECT_GT(m.bendingStiffness(), 0.0);
        EXPECT_NEAR(m.areaDensity(), m.density * m.thickness, 1e-12);
        EXPECT_NEAR(m.stretchStiffness(), m.young * m.thickness, 1e-6);
    }
}

TEST(MaterialPresetTest, AnUnknownNameGetsTheNearestOne) {
    EXPECT_EQ(lookUpComplaint("stel"), "unknown material \"stel\"; did you mean \"steel\"?");
    EXPECT_EQ(lookUpComplaint("Aluminum"), "unknown material \"Aluminum\"; did you mean \"aluminium\"?");
    EXPECT_EQ(lookUpComplaint("coton"), "unknown material \"coton\"; did you mean \"cotton\"?");
    EXPECT_NE(lookUpComplaint(""), "");
}

}  // namespace
}  // namespace jacket
