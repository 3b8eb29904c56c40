#pragma once
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "Commands.h"

namespace jacket::demo {

struct Outcome {
    int exitCode;
    std::string out, err;
};

/// The program with these arguments, in this process.
inline Outcome jacket(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "jacket");
    std::vector<const char*> argv;
    for (const std::string& argument : arguments) argv.push_back(argument.c_str());
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const int exitCode = runProgram(static_cast<int>(argv.size()), argv.data());
    return {exitCode, testing::internal::GetCapturedStdout(), testing::internal::GetCapturedStderr()};
}

/// A sheet that a ball has just reached, so that contacts, bodies and shells all have a past.
inline constexpr const char* kBallOnSheet = R"({
    "dt": "1/60", "seconds": 0.2,
    "shells": [ { "name": "sheet", "mesh": { "grid": { "size": [1, 1], "cells": [6, 6] } },
                  "material": { "stretch_stiffness": 1e3, "bending_stiffness": 1e-4, "area_density": 0.3, "poisson": 0.3,
                                "thickness": 1e-3 },
                  "pin": [ { "vertices": [0, 6, 42, 48] } ] } ],
    "bodies": [ { "name": "ball", "shape": { "sphere": 0.2 }, "mass": 0.5, "position": [0.02, 0.25, 0.01],
                  "velocity": [0, -1, 0] } ]
})";

}  // namespace jacket::demo
