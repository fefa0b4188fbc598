// report.html: one file without anything from outside, so that it can be sent and kept.

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "common/base/quote.h"
#include "tests/validation/report.h"

namespace trocar::validation {
namespace {

constexpr const char* kStyle = R"(
:root { --ink: #1c2730; --dim: #5c6b77; --line: #dde4ea; --ground: #f5f7f9; --kept: #1a7f4b;
  --broken: #b3261e; --missed: #b26a00; --accent: #0b5c8a; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--ink);
  font: 16px/1.55 "Segoe UI", "Helvetica Neue", Arial, "DejaVu Sans", sans-serif; }
main { max-width: 1080px; margin: 0 auto; padding: 2rem 1.25rem 4rem; }
h1 { font-size: 2rem; margin: 0 0 .3rem; }
h2 { font-size: 1.35rem; margin: 0; }
h2 a { color: inherit; text-decoration: none; }
h3 { font-size: 1rem; margin: 1.6rem 0 .4rem; }
p { max-width: 46rem; margin: .7rem 0; }
.dim { color: var(--dim); }
.small { font-size: .86rem; }
code, pre { font-family: "Cascadia Mono", Menlo, "DejaVu Sans Mono", monospace; font-size: .84rem; }
section, .summary { background: #fff; border: 1px solid var(--line); border-radius: 10px;
  padding: 1.4rem 1.6rem; margin: 1.4rem 0; }
.table { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .9rem; margin: .5rem 0; }
th, td { text-align: left; padding: .38rem .7rem .38rem 0; border-bottom: 1px solid var(--line);
  vertical-align: top; }
th { color: var(--dim); font-weight: 600; white-space: nowrap; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
td.short { white-space: nowrap; }
tr:last-child td { border-bottom: 0; }
table.data { width: auto; min-width: 40%; }
table.data th, table.data td { padding-right: 1.6rem; }
.pill { display: inline-block; border-radius: 99px; padding: 0 .65rem; font-size: .8rem;
  font-weight: 600; color: #fff; background: var(--kept); white-space: nowrap; }
.pill.broken { background: var(--broken); }
.pill.missed { background: var(--missed); }
.pill.measured { background: var(--dim); }
a { color: var(--accent); }
figure { margin: 1.2rem 0; }
figure svg { display: block; max-width: 100%; height: auto; }
details { margin: .5rem 0; }
summary { cursor: pointer; color: var(--accent); }
pre { background: var(--ground); border: 1px solid var(--line); border-radius: 6px;
  padding: .8rem 1rem; overflow-x: auto; line-height: 1.4; max-height: 32rem; }
@media print { section { break-inside: avoid-page; } }
)";

std::string anchor(const std::string& name) {
  std::string out = name;
  std::replace(out.begin(), out.end(), '/', '-');
  return out;
}

std::string pill(Verdict verdict) {
  const char* style = verdict == Verdict::Kept       ? "pill"
                      : verdict == Verdict::Missed   ? "pill missed"
                      : verdict == Verdict::Measured ? "pill measured"
                                                     : "pill broken";
  return fmt::format("<span class=\"{}\">{}</span>", style, name_of(verdict));
}

// Returns the worst verdict of an experiment's checks.
Verdict verdict_of(const Section& section) {
  const auto counts = count(section.checks);
  return counts.failed > 0   ? Verdict::Broken
         : counts.missed > 0 ? Verdict::Missed
         : counts.kept > 0   ? Verdict::Kept
                             : Verdict::Measured;
}

bool is_number(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789.+-e %") == std::string::npos;
}

std::string cell(const std::string& text, const char* tag = "td") {
  return fmt::format("<{0}{1}>{2}</{0}>", tag, is_number(text) ? " class=\"number\"" : "",
                     html_escaped(text));
}

std::string size_of(double value, bool is_relative) {
  if (!std::isfinite(value)) return "none";
  return is_relative ? shown_percent(value) : shown(value);
}

// A value of one or two words stays on one line.
std::string short_cell(const std::string& text) {
  constexpr std::size_t kShort = 18;
  return fmt::format("<td{}>{}</td>", text.size() <= kShort ? " class=\"short\"" : "",
                     html_escaped(text));
}

std::string checks_table(const Section& section) {
  std::string out =
      "<div class=\"table\"><table><tr><th>check</th><th>paper or reference</th><th>ours</th>"
      "<th class=\"number\">error</th><th class=\"number\">bound</th><th>source of the "
      "bound</th><th></th></tr>";
  for (const auto& check : section.checks) {
    const auto what = check.name.substr(section.name.size() + 1);
    out += fmt::format(
        "<tr><td><code>{}</code><br><span class=\"small dim\">{}</span></td>{}{}"
        "<td class=\"number\">{}</td><td class=\"number\">{}</td><td "
        "class=\"small\">{}</td><td>{}</td></tr>",
        html_escaped(what), html_escaped(check.note), short_cell(check.expected),
        short_cell(check.ours), check.has_bound ? size_of(check.error, check.is_relative) : "",
        check.has_bound ? size_of(check.bound.value, check.is_relative) : "",
        check.has_bound ? html_escaped(check.bound.words()) : "", pill(check.verdict()));
  }
  return out + "</table></div>";
}

std::string table(const Table& table) {
  std::string out =
      "<h3>" + html_escaped(table.title) + "</h3><div class=\"table\"><table class=\"data\"><tr>";
  for (std::size_t i = 0; i < table.head.size(); ++i) {
    const bool is_numeric = !table.rows.empty() && is_number(table.rows.front()[i]);
    out += is_numeric ? "<th class=\"number\">" : "<th>";
    out += html_escaped(table.head[i]) + "</th>";
  }
  out += "</tr>";
  for (const auto& row : table.rows) {
    out += "<tr>";
    for (const auto& text : row) out += cell(text);
    out += "</tr>";
  }
  return out + "</table></div>";
}

// The svg element alone: a page has no place for a second XML declaration.
std::string figure(const std::string& svg) {
  const auto begin = svg.find("<svg");
  return "<figure>" + (begin == std::string::npos ? svg : svg.substr(begin)) + "</figure>";
}

std::string scenes(const Section& section) {
  if (section.scenes.empty()) return "";
  std::string out =
      "<h3>Scenarios</h3><p class=\"small dim\">Each is beside this report in "
      "<code>scenarios/</code>; <code>trocar-sim FILE</code> runs it.</p>";
  std::vector<std::string> families;
  for (const auto& scene : section.scenes)
    if (std::find(families.begin(), families.end(), scene.family) == families.end())
      families.push_back(scene.family);
  for (const auto& family : families) {
    std::string text, others;
    for (const auto& scene : section.scenes) {
      if (scene.family != family) continue;
      if (text.empty())
        text = fmt::format("<summary><code>{}.toml</code></summary><pre>{}</pre>",
                           html_escaped(scene.name), html_escaped(scene.text));
      else
        others += (others.empty() ? "" : ", ") + scene.name + ".toml";
    }
    if (!others.empty())
      text += "<p class=\"small dim\">and the same with other values: <code>" +
              html_escaped(others) + "</code></p>";
    out += "<details>" + text + "</details>";
  }
  return out;
}

std::string summary(const Report& report) {
  std::string out = fmt::format(
      "<div class=\"summary\"><h2>{}</h2><div class=\"table\"><table>"
      "<tr><th>experiment</th><th>what</th><th class=\"number\">checks</th>"
      "<th class=\"number\">CPU time</th><th></th></tr>",
      html_escaped(totals(report.sections)));
  for (const auto& section : report.sections) {
    out += fmt::format(
        "<tr><td><a href=\"#{}\"><code>{}</code></a></td><td>{}</td><td class=\"number\">{}</td>"
        "<td class=\"number\">{:.1f} s</td><td>{}</td></tr>",
        anchor(section.name), html_escaped(section.name), html_escaped(section.title),
        section.checks.size(), section.seconds, pill(verdict_of(section)));
  }
  return out + "</table></div></div>";
}

}  // namespace

std::string to_html(const Report& report) {
  std::string out = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">"
      "<title>Trocar: validation</title><style>{}</style></head><body><main>"
      "<h1>Trocar: validation</h1>"
      "<p class=\"dim\">An experiment that is a scenario has it below, for "
      "<code>trocar-sim</code>. An error is relative to the value beside it; a bound is what the "
      "tests hold us to, and one "
      "that is not kept says so. Times are of this machine.</p>"
      "<p class=\"small dim\">{} &middot; {} &middot; <code>{}</code>{}</p>",
      kStyle, html_escaped(report.date), html_escaped(report.processor + ", " + report.compiler),
      html_escaped(report.command),
      report.is_short ? " &middot; short form: coarser meshes, fewer points" : "");
  out += summary(report);
  for (const auto& section : report.sections) {
    out += fmt::format(
        "<section id=\"{0}\"><h2><a href=\"#{0}\">{1}</a></h2>"
        "<p class=\"small dim\"><code>{2}</code> &middot; {3}</p>",
        anchor(section.name), html_escaped(section.title), html_escaped(section.name),
        html_escaped(section.source));
    out += checks_table(section);
    auto svg = section.svgs.begin();
    for (const auto& part : section.parts) {
      if (const auto* paragraph = std::get_if<std::string>(&part)) {
        out += "<p>" + html_escaped(*paragraph) + "</p>";
      } else if (const auto* rows = std::get_if<Table>(&part)) {
        out += table(*rows);
      } else {
        out += figure(*svg++);
      }
    }
    out += scenes(section) + "</section>";
  }
  return out + "</main></body></html>\n";
}

}  // namespace trocar::validation
