#pragma once
#include <ostream>
#include <string>

#include "Json.h"
#include "Report.h"

namespace jacket::demo::report {

/// report.json.
Json toJson(const Report& report);

/// CSV with a heading line.
std::string staticsCsv(const Report& report);
std::string motionCsv(const Report& report);
std::string integratorsCsv(const Report& report);
std::string momentumCsv(const Report& report);
std::string cheapestMotionCsv(const Report& report);
std::string cheapestStaticsCsv(const Report& report);

/// The answer, for a terminal.
void printCheapest(std::ostream& out, const Report& report);

/// "1/240 s".
std::string stepText(double dt);

}  // namespace jacket::demo::report
