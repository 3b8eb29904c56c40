#include "accuracy/References.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

/// The constants in the code are those of the tables.
namespace jacket::demo::accuracy {
namespace {

nlohmann::json jsonOf(const std::string& file) {
    std::ifstream in(std::string(JACKET_TEST_DATA) + "/" + file);
    return nlohmann::json::parse(in);
}

/// The row of a table whose first column is `key`.
std::vector<double> rowOf(const std::string& file, double key) {
    std::ifstream in(std::string(JACKET_TEST_DATA) + "/" + file);
    std::string line;
    std::getline(in, line);  // column names
    while (std::getline(in, line)) {
        std::vector<double> row;
        std::istringstream cells(line);
        for (std::string cell; std::getline(cells, cell, ',');) row.push_back(std::stod(cell));
        if (std::abs(row.at(0) - key) < 1e-9) return row;
    }
    throw std::runtime_error(file + " has no row " + std::to_string(key));
}

TEST(References, StripsAgreeWithTheTables) {
    for (const HeavyTip& tip : kHeavyTips) {
        const auto row = rowOf("heavy_elastica.csv", tip.gamma);
        EXPECT_DOUBLE_EQ(row[1], tip.x);
        EXPECT_DOUBLE_EQ(row[2], tip.drop);
    }
    for (const LoadedTip& tip : kLoadedTips) {
        const auto row = rowOf("end_load_elastica.csv", tip.load);
        EXPECT_DOUBLE_EQ(row[1], tip.x);
        EXPECT_DOUBLE_EQ(row[3], tip.drop);
    }
    for (const HangingCurve& curve : kCatenaries) EXPECT_DOUBLE_EQ(rowOf("catenary.csv", curve.span)[1], curve.sag);
}

TEST(References, PlatesAgreeWithTheTables) {
    const auto table = jsonOf("plates_and_buckling.json");
    EXPECT_DOUBLE_EQ(table["ssss"]["alpha_uniform"], kSupportedPlate.uniform);
    EXPECT_DOUBLE_EQ(table["ssss"]["beta_centre"], kSupportedPlate.centre);
    EXPECT_DOUBLE_EQ(table["cccc"]["alpha_uniform"], kClampedPlate.uniform);
    EXPECT_DOUBLE_EQ(table["cccc"]["beta_centre_extrapolated"], kClampedPlate.centre);
    for (const PlateFrequencies& entry : kPlateFrequencies) {
        const std::string suffix = entry.poisson == 0.0 ? "_square_nu0" : "_square_nu0.3";
        for (std::size_t i = 0; i < entry.free.size(); ++i) {
            EXPECT_DOUBLE_EQ(table["ffff" + suffix][i], entry.free[i]);
            EXPECT_DOUBLE_EQ(table["cfff" + suffix][i], entry.cantilever[i]);
        }
    }
    const auto hanging = jsonOf("hanging_sheet.json")["hanging_sheet_omega_sqrt_L_over_g"];
    for (std::size_t i = 0; i < kHangingFrequencies.size(); ++i) EXPECT_DOUBLE_EQ(hanging[i], kHangingFrequencies[i]);
    const auto buckling = table["lateral_buckling_selfweight_Gamma_c"];
    EXPECT_DOUBLE_EQ(buckling["nu0_b/L=0.25"]["Gamma_c"], kLateralBuckling[0].gamma);
    EXPECT_DOUBLE_EQ(buckling["nu0.3_b/L=0.25"]["Gamma_c"], kLateralBuckling[1].gamma);
}

TEST(References, ShellsAgreeWithTheTables) {
    const auto linear = jsonOf("linear_benchmarks.json");
    EXPECT_TRUE(linear["Scordelis-Lo roof"]["refs"].contains("0.3006 (Kirchhoff-Love isogeometric)"));
    EXPECT_DOUBLE_EQ(kScordelisLo, 0.3006);
    EXPECT_TRUE(linear["pinched hemisphere 18deg hole"]["refs"].contains("0.0935 (Simo et al.)"));
    EXPECT_DOUBLE_EQ(kHemisphere, 0.0935);
    const auto roof = jsonOf("sze2004_tables.json")["3.8a hinged roof h=12.7 isotropic"]["data"];
    for (const SnapThrough& point : {kRoofLimit, kRoofValley}) {
        bool found = false;
        for (const auto& row : roof) found = found || (row[0] == point.load && row[1] == point.deflection);
        EXPECT_TRUE(found) << point.deflection;
    }
}

}  // namespace
}  // namespace jacket::demo::accuracy
