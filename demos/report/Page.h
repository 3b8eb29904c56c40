#pragma once
#include <string>
#include <vector>

#include "Report.h"

namespace jacket::demo::report {

/// A plot of the report, as a file and as a part of the page.
struct Picture {
    std::string name;  ///< of the file, without extension
    std::string svg;
};

/// Error against cost, one of each motion.
std::vector<Picture> motionPictures(const Report& report);
/// Error against cells, one of each settled shape.
std::vector<Picture> staticPictures(const Report& report);

/// The whole report for people.
std::string pageOf(const Report& report);

}  // namespace jacket::demo::report
