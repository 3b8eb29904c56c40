#include "Profile.h"

#include <algorithm>
#include <cstdio>
#include <ostream>

namespace jacket::demo {

void Profile::add(const FrameReport& frame, int steps, double secondsAround) {
    m_steps += steps;
    m_solves += frame.solves;
    m_iterations += frame.pcgIterations;
    m_seconds += frame.seconds;
    m_around += secondsAround;
    m_where.narrowPhase += frame.where.narrowPhase;
    m_where.parts += frame.where.parts;
    m_where.solves += frame.where.solves;
    m_where.shells += frame.where.shells;
}

std::vector<Profile::Part> Profile::parts() const {
    const StepTimes& inSolve = m_where.parts;
    return {{"Bullet: broadphase, rigid bodies", m_seconds - m_where.shells},
            {"narrow phase of shells", m_where.narrowPhase},
            {"contact response", inSolve.contact - m_where.narrowPhase},
            {"assembly", inSolve.assembly},
            {"factor", inSolve.factor},
            {"solve", inSolve.solve},
            {"self-collision", inSolve.selfCollision},
            {"checks of energy and stretch", m_where.solves - inSolve.sum()},
            {"moving, islands, sleeping", m_where.shells - m_where.solves}};
}

Json Profile::json() const {
    const double steps = std::max(1, m_steps), all = std::max(m_seconds, 1e-12);
    Json json{{"steps", m_steps},
              {"solves_per_step", m_solves / steps},
              {"iterations_per_step", m_iterations / steps},
              {"parts", Json::array()}};
    for (const Part& part : parts())
        json["parts"].push_back({{"part", part.name},
                                 {"ms_per_step", 1e3 * part.seconds / steps},
                                 {"percent", 100.0 * part.seconds / all}});
    json["ms_per_step"] = 1e3 * m_seconds / steps;
    json["recording_ms_per_step"] = 1e3 * m_around / steps;
    return json;
}

void printProfile(std::ostream& out, const Json& profile) {
    char line[128];
    const auto row = [&](const std::string& part, double ms, const std::string& share) {
        std::snprintf(line, sizeof line, "  %-34s %10.4f %9s\n", part.c_str(), ms, share.c_str());
        out << line;
    };
    std::snprintf(line, sizeof line, "%-36s %10s %9s\n", "where the time went", "ms/step", "per cent");
    out << line;
    for (const Json& part : profile["parts"]) {
        char share[16];
        std::snprintf(share, sizeof share, "%.1f", part["percent"].get<double>());
        row(part["part"], part["ms_per_step"], share);
    }
    row("a step", profile["ms_per_step"], "100");
    row("besides: measuring and writing", profile["recording_ms_per_step"], "");
    std::snprintf(line, sizeof line, "  %d steps; %.3g solves and %.4g iterations a step\n",
                  profile["steps"].get<int>(), profile["solves_per_step"].get<double>(),
                  profile["iterations_per_step"].get<double>());
    out << line;
}

}  // namespace jacket::demo
