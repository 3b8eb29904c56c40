#pragma once
#include <string>

namespace jacket::demo {

/// What times were measured on.
struct Machine {
    std::string cpu, compiler, flags, precision, bullet;
    int cores = 0;
};
Machine thisMachine();

}  // namespace jacket::demo
