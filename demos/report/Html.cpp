#include "Html.h"

#include "Svg.h"

namespace jacket::demo::report {

namespace {

constexpr const char* kStyle = R"css(
:root { color-scheme: light dark; --ink: #1d2125; --paper: #fcfcfb; --soft: #62686e; --line: #d9dcdf; --tint: #f1f3f4; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e4e6e8; --paper: #17191b; --soft: #9aa1a7; --line: #363b40; --tint: #202427; } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 78rem; padding: 2rem 1.5rem 5rem; color: var(--ink); background: var(--paper);
       font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; }
h1 { font-size: 1.6rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.25rem; margin: 2.6rem 0 .6rem; padding-top: 1.2rem; border-top: 1px solid var(--line); }
h3 { font-size: 1rem; margin: 1.8rem 0 .3rem; }
p { max-width: 52rem; margin: .4rem 0 .8rem; }
.soft, caption { color: var(--soft); font-size: .87rem; }
.scroll { overflow-x: auto; margin: .6rem 0 1.2rem; }
table { border-collapse: collapse; font-size: .87rem; font-variant-numeric: tabular-nums; }
caption { caption-side: bottom; text-align: left; padding-top: .4rem; }
th { text-align: left; font-weight: 600; border-bottom: 1.5px solid var(--soft); vertical-align: bottom; }
th, td { padding: .28rem 1.1rem .28rem 0; }
td { border-bottom: 1px solid var(--line); vertical-align: top; }
.number { text-align: right; white-space: nowrap; }
td b { font-weight: 600; }
td small { color: var(--soft); font-size: .8rem; }
.good { color: #1c7c43; } .bad { color: #b3402f; }
@media (prefers-color-scheme: dark) { .good { color: #63c48c; } .bad { color: #ec8674; } }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(34rem, 100%), 1fr)); gap: 1rem 1.6rem; }
svg { width: 100%; height: auto; display: block; }
details { margin: .6rem 0; } summary { cursor: pointer; color: var(--soft); }
)css";

}  // namespace

std::string toHtml(const HtmlTable& table) {
    const auto isNumber = [&](std::size_t column) { return table.headings[column].starts_with('#'); };
    std::string html = "<div class=\"scroll\"><table>";
    if (!table.caption.empty()) html += "<caption>" + table.caption + "</caption>";
    html += "<thead><tr>";
    for (std::size_t c = 0; c < table.headings.size(); ++c)
        html += isNumber(c) ? "<th class=\"number\">" + table.headings[c].substr(1) + "</th>"
                            : "<th>" + table.headings[c] + "</th>";
    html += "</tr></thead><tbody>\n";
    for (const auto& row : table.rows) {
        html += "<tr>";
        for (std::size_t c = 0; c < row.size(); ++c)
            html += (isNumber(c) ? "<td class=\"number\">" : "<td>") + row[c] + "</td>";
        html += "</tr>\n";
    }
    return html + "</tbody></table></div>\n";
}

std::string htmlPage(const std::string& title, const std::string& body) {
    return "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
           "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><title>" +
           escaped(title) + "</title><style>" + kStyle + "</style></head>\n<body>\n" + body + "</body></html>\n";
}

std::string folded(const std::string& summary, const std::string& body) {
    return "<details><summary>" + summary + "</summary>\n" + body + "</details>\n";
}

}  // namespace jacket::demo::report
