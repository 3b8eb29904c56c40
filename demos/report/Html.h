#pragma once
#include <string>
#include <vector>

namespace jacket::demo::report {

/// A table of a page. Cells are HTML already; a column whose heading starts with '#' holds numbers and is set flush
/// right (the '#' is not shown).
struct HtmlTable {
    std::vector<std::string> headings;
    std::vector<std::vector<std::string>> rows;
    std::string caption;
};
std::string toHtml(const HtmlTable& table);

/// One page with everything in it: no other files, nothing from the network.
std::string htmlPage(const std::string& title, const std::string& body);

/// Hidden until the reader opens it.
std::string folded(const std::string& summary, const std::string& body);

}  // namespace jacket::demo::report
