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
        EXPECT_EQ(m.thickness, preset.usualThickness) << preset.name;
        EXPECT_EQ(preset.make(2e-3).thickness, 2e-3) << preset.name;
        EXPECT_FALSE(preset.source.empty()) << preset.name;
    }
    EXPECT_EQ(materials::byName("Steel").young, materials::steel(1e-3).young);
    EXPECT_EQ(materials::byName("pet").density, materials::pet().density);
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
