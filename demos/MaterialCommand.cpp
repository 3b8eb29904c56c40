#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <numbers>
#include <optional>

#include "Commands.h"
#include "Json.h"
#include "jacket/Material.h"

namespace jacket::demo {

namespace {

constexpr double kGravity = 9.81;  // m/s^2

void printQuantity(const char* what, const char* symbol, double value, const char* unit, const char* note = "") {
    char line[160];
    std::snprintf(line, sizeof line, "  %-30s %-16s %12.5g  %-8s %s\n", what, symbol, value, unit, note);
    std::cout << line;
}

/// First period of a narrow strip of length 1 m clamped at one end: omega = 1.8751^2 sqrt(EI / (rho t)) / L^2. Its long
/// sides are free to curl, so that it is a beam, EI = D (1 - nu^2) per width; a strip wider than it is long would swing
/// as a plate, with D, up to 1 / sqrt(1 - nu^2) times as fast.
double stripPeriod(const ShellMaterial& m) {
    constexpr double kFirstRoot = 1.8751040687;  // of cos x cosh x = -1
    const double bending = m.bendingStiffness() * (1 - m.poisson * m.poisson);
    const double omega = kFirstRoot * kFirstRoot * std::sqrt(bending / m.areaDensity());
    return 2 * std::numbers::pi / omega;
}

void printOrthotropy(const ShellMaterial& m) {
    const auto& weave = *m.orthotropy;
    const double bias = 4 / (1 / m.young + 1 / weave.weftYoung + 1 / weave.shear - 2 * m.poisson / m.young);
    printQuantity("weft's Young's modulus", "E_2", weave.weftYoung, "Pa", "E and nu above are the warp's");
    printQuantity("shear modulus", "G", weave.shear, "Pa");
    printQuantity("modulus at 45 degrees", "E_45", bias, "Pa", "of a strip cut on the bias");
}

void printYield(const ShellMaterial& m) {
    printQuantity("yield stress", "sigma_y", *m.yieldStress, "Pa");
    printQuantity("hardening", "H", m.hardening, "Pa", "rise of the yield stress over plastic strain");
}

void printPreset(const materials::Preset& preset, const ShellMaterial& m) {
    const auto note = [](const auto& measured) { return measured ? "measured" : ""; };
    std::cout << preset.name << ": " << preset.source << '\n';
    printQuantity("thickness", "t", m.thickness, "m");
    printQuantity("density", "rho", m.density, "kg/m3");
    printQuantity("Young's modulus", "E", m.young, "Pa");
    printQuantity("Poisson's ratio", "nu", m.poisson, "-");
    if (m.orthotropy) printOrthotropy(m);
    if (m.yieldStress) printYield(m);
    printQuantity("stretching stiffness", "E t", m.stretchStiffness(), "N/m", note(m.stretchStiffnessOverride));
    printQuantity("bending stiffness", "D", m.bendingStiffness(), "N m", note(m.bendingStiffnessOverride));
    printQuantity("area density", "rho t", m.areaDensity(), "kg/m2", note(m.areaDensityOverride));
    printQuantity("stiffness damping", "beta", m.stiffnessDamping, "s");
    printQuantity("mass damping", "alpha", m.massDamping, "1/s");
    std::cout << "which means\n";
    printQuantity("period of a 1 m clamped strip", "T", stripPeriod(m), "s",
                  "narrow beam, EI = D (1 - nu^2), in vacuum, no gravity");
    printQuantity("bending length", "(D/rho t g)^1/3", std::cbrt(m.bendingStiffness() / (m.areaDensity() * kGravity)),
                  "m", "about how far it holds itself up");
    printQuantity("strain of 1 m hanging", "rho g/E", m.areaDensity() * kGravity / m.stretchStiffness(), "-",
                  "at the upper end, under its own weight");
    printQuantity("speed of stretching waves", "c",
                  std::sqrt(m.stretchStiffness() / ((1 - m.poisson * m.poisson) * m.areaDensity())), "m/s");
    if (!m.yieldStress) {
        std::cout << "  never yields: it springs back however far it is bent\n";
        return;
    }
    printQuantity("yield curvature", "e_y", m.yieldCurvature(), "1/m", "where the outermost fibre yields");
    printQuantity("tightest elastic radius", "1/e_y", 1 / m.yieldCurvature(), "m", "rolled tighter, it stays bent");
}

void showMaterial(const std::string& name, std::optional<double> thickness) {
    std::vector<std::string> names;
    for (const auto& preset : materials::presets()) {
        if (preset.name == name) {
            printPreset(preset, preset.make(thickness.value_or(preset.usual.thickness)));
            return;
        }
        names.emplace_back(preset.name);
    }
    throw InputError("unknown material \"" + name + "\"" + suggestion(name, names));
}

void listMaterials() {
    std::cout << "Presets (jacket material NAME says what each means):\n";
    for (const auto& preset : materials::presets()) {
        char line[64];
        std::snprintf(line, sizeof line, "  %-12s usually %g mm\n", std::string(preset.name).c_str(),
                      1e3 * preset.usual.thickness);
        std::cout << line;
    }
}

}  // namespace

void addMaterialCommand(CLI::App& app, int&) {
    CLI::App* command = app.add_subcommand("material", "What a material preset means, with derived quantities");
    auto name = std::make_shared<std::string>();
    auto thickness = std::make_shared<double>(0.0);
    command->add_option("name", *name, "Preset; without it all are listed");
    CLI::Option* given = command->add_option("--thickness", *thickness, "Of the sheet [m]");
    command->footer("Example:  jacket material steel --thickness 0.8e-3");
    command->callback([name, thickness, given] {
        if (given->count() && !(*thickness > 0 && std::isfinite(*thickness)))
            throw InputError("--thickness [m] must be > 0, got " + shortNumber(*thickness));
        if (name->empty()) return listMaterials();
        showMaterial(*name, given->count() ? std::optional(*thickness) : std::nullopt);
    });
}

}  // namespace jacket::demo
