#include "Machine.h"

#include <fstream>
#include <thread>

#include "World.h"

namespace jacket::demo {

Machine thisMachine() {
    Machine machine;
    std::ifstream info("/proc/cpuinfo");
    for (std::string line; std::getline(info, line) && machine.cpu.empty();)
        if (line.starts_with("model name")) machine.cpu = line.substr(line.find(':') + 2);
    if (machine.cpu.empty()) machine.cpu = "unknown processor";
    machine.cores = static_cast<int>(std::thread::hardware_concurrency());
#if defined(__clang__)
    machine.compiler = "Clang " __clang_version__;
#elif defined(__GNUC__)
    machine.compiler = "GCC " __VERSION__;
#else
    machine.compiler = "unknown compiler";
#endif
    machine.flags = JACKET_BUILD_FLAGS;
    machine.precision = World::precision();
    machine.bullet = World::bulletVersion();
    return machine;
}

}  // namespace jacket::demo
