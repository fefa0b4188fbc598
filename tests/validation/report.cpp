#include "tests/validation/report.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>

#include "common/base/json.h"

namespace trocar::validation {
namespace {

std::string number(double value) {
  return std::isfinite(value) ? fmt::format("{:.9g}", value) : "null";
}

// JSON has no infinity and no NaN.
Json json_number(double value) {
  return std::isfinite(value) ? Json(value) : Json();
}

// A text that is a number goes out as one.
Json json_value(const std::string& text) {
  if (text.empty()) return {};
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  return *end == '\0' && std::isfinite(value) ? Json(value) : Json(text);
}

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

// Escapes the bar, which separates the cells of a Markdown table.
std::string md_cell(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '|' ? std::string("\\|") : std::string(1, c);
  return out;
}

std::string size_of(const Check& check, double value) {
  if (!std::isfinite(value)) return "none";
  return check.is_relative ? shown_percent(value) : shown(value);
}

const char* word_of(Origin origin) {
  switch (origin) {
    case Origin::Law:
      return "law";
    case Origin::Paper:
      return "paper";
    case Origin::Target:
      return "target";
  }
  return "";
}

}  // namespace

Bound Bound::missed(double on_record) const {
  Bound bound = *this;
  bound.largest_missed = on_record;
  return bound;
}

std::string Bound::words() const {
  return std::string(word_of(origin)) + ": " + source;
}

Bound law(double value, std::string source) {
  return {value, Origin::Law, std::move(source), {}};
}
Bound paper(double value, std::string source) {
  return {value, Origin::Paper, std::move(source), {}};
}
Bound target(double value, std::string source) {
  return {value, Origin::Target, std::move(source), {}};
}

const char* name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::Kept:
      return "kept";
    case Verdict::Missed:
      return "missed";
    case Verdict::Broken:
      return "broken";
    case Verdict::Outdated:
      return "outdated";
    case Verdict::Measured:
      return "measured";
  }
  return "";
}

Verdict Check::verdict() const {
  if (!has_bound) return Verdict::Measured;
  if (!bound.largest_missed) return is_kept() ? Verdict::Kept : Verdict::Broken;
  if (is_kept()) return Verdict::Outdated;
  return error <= *bound.largest_missed ? Verdict::Missed : Verdict::Broken;
}

Counts count(const std::vector<Check>& checks) {
  Counts counts;
  for (const auto& check : checks) {
    const auto verdict = check.verdict();
    counts.kept += verdict == Verdict::Kept;
    counts.missed += verdict == Verdict::Missed;
    counts.failed += check.fails();
    counts.measured += verdict == Verdict::Measured;
  }
  return counts;
}

std::string totals(const std::vector<Section>& sections) {
  Counts sum;
  for (const auto& section : sections) {
    const auto counts = count(section.checks);
    sum.kept += counts.kept;
    sum.missed += counts.missed;
    sum.failed += counts.failed;
    sum.measured += counts.measured;
  }
  return fmt::format("{} bounds kept, {} missed as declared, {} broken, {} figures without a bound",
                     sum.kept, sum.missed, sum.failed, sum.measured);
}

std::string shown(double value) {
  return fmt::format("{:.4g}", value);
}

std::string shown_percent(double share) {
  return fmt::format("{:.3g} %", 100 * share);
}

void Section::compare(const std::string& what, double expected, double ours, Bound bound,
                      const std::string& unit, const std::string& note) {
  const std::string end = unit.empty() ? "" : " " + unit;
  checks.push_back({name + "/" + what, shown(expected) + end, shown(ours) + end,
                    std::abs(ours - expected) / std::abs(expected), std::move(bound), true, note});
}

void Section::at_most(const std::string& what, const std::string& expected, double error,
                      Bound bound, const std::string& note) {
  checks.push_back({name + "/" + what, expected, shown_percent(error) + " off", error,
                    std::move(bound), true, note});
}

void Section::at_least(const std::string& what, const std::string& expected, double ours,
                       Bound least, const std::string& note) {
  const double shortfall = std::isfinite(ours) ? std::max(0.0, least.value - ours)
                                               : std::numeric_limits<double>::quiet_NaN();
  const double wanted = least.value;
  if (least.largest_missed) least.largest_missed = wanted - *least.largest_missed;
  least.value = 0;
  checks.push_back({name + "/" + what, expected, shown(ours), shortfall, std::move(least), false,
                    note + " At least " + shown(wanted) + "."});
}

void Section::exactly(const std::string& what, const std::string& expected, const std::string& ours,
                      Bound bound, const std::string& note) {
  checks.push_back({name + "/" + what, expected, ours, expected == ours ? 0.0 : 1.0,
                    std::move(bound), false, note});
}

void Section::measured(const std::string& what, const std::string& ours, const std::string& note) {
  checks.push_back({name + "/" + what, "", ours, 0, {}, false, note, false});
}

Status Section::draw() {
  svgs.clear();
  for (const auto& part : parts) {
    const auto* const plot = std::get_if<plot::Plot>(&part);
    if (plot == nullptr) continue;
    auto svg = plot::to_svg(*plot);
    if (!svg) return Error{svg.error().code, "plot '" + plot->title + "': " + svg.error().message};
    svgs.push_back(std::move(*svg));
  }
  return {};
}

void Section::check_convergence() {
  if (unconverged_steps == 0) return;
  exactly("converged", "0 steps", fmt::format("{} steps", unconverged_steps),
          law(0, "the tolerance of the scenario"),
          fmt::format("Steps that did not reach the tolerance of their scenario, of {}.", steps));
}

std::string to_json(const std::vector<Section>& sections) {
  Json all = Json::array();
  for (const auto& section : sections)
    for (const auto& check : section.checks) {
      const auto& missed = check.bound.largest_missed;
      all.push_back({{"name", check.name},
                     {"paper", json_value(check.expected)},
                     {"ours", json_value(check.ours)},
                     {"error", json_number(check.error)},
                     {"bound", check.has_bound ? json_number(check.bound.value) : Json()},
                     {"kept", check.has_bound && check.is_kept()},
                     {"verdict", name_of(check.verdict())},
                     {"source", check.has_bound ? Json(check.bound.words()) : Json()},
                     {"largest_missed", missed ? json_number(*missed) : Json()},
                     {"note", check.note}});
    }
  return to_text(all);
}

std::string run_to_json(const Report& report) {
  Json experiments = Json::array();
  for (const auto& section : report.sections) {
    const auto counts = count(section.checks);
    experiments.push_back({{"name", section.name},
                           {"title", section.title},
                           {"source", section.source},
                           {"cpu_s", section.seconds},
                           {"steps", section.steps},
                           {"unconverged_steps", section.unconverged_steps},
                           {"state_hash", hex64(section.state_hash)},
                           {"kept", counts.kept},
                           {"missed", counts.missed},
                           {"failed", counts.failed},
                           {"measured", counts.measured}});
  }
  return to_text({{"machine",
                   {{"processor", report.processor},
                    {"compiler", report.compiler},
                    {"load_before", report.load_before},
                    {"load_after", report.load_after}}},
                  {"commit", report.commit},
                  {"date", report.date},
                  {"command", report.command},
                  {"is_short", report.is_short},
                  {"experiments", experiments}});
}

std::string to_csv(const std::vector<Section>& sections) {
  std::string out = "name,expected,ours,error,bound,verdict,source,largest_missed,note\n";
  for (const auto& section : sections)
    for (const auto& check : section.checks)
      out += fmt::format("{},{},{},{},{},{},{},{},{}\n", csv_field(check.name),
                         csv_field(check.expected), csv_field(check.ours),
                         check.has_bound ? number(check.error) : "",
                         check.has_bound ? number(check.bound.value) : "", name_of(check.verdict()),
                         check.has_bound ? csv_field(check.bound.words()) : "",
                         check.bound.largest_missed ? number(*check.bound.largest_missed) : "",
                         csv_field(check.note));
  return out;
}

std::string plot_file(const Section& section) {
  std::string name = section.name;
  std::ranges::replace(name, '/', '-');
  return "plots/" + name + ".svg";
}

std::string to_markdown(const Report& report) {
  std::string out = fmt::format(
      "# Validation\n\n"
      "This page is generated by `deploy/tables` from the results of `{}`. Do not edit "
      "it.\n\n"
      "- Machine: {}, {}.\n- Commit: {}, {}.\n- Load of the machine: {:.2f} before, {:.2f} "
      "after.\n\n"
      "A bound comes from a law, from the paper or from a target of this project, never from a "
      "measurement. *Missed* is a bound that is not kept and is known not to be. *Measured* has no "
      "bound.\n",
      report.command, report.processor, report.compiler, report.commit, report.date,
      report.load_before, report.load_after);
  out +=
      "\n| experiment | kept | missed | broken | measured only | CPU, s | state hash |\n"
      "|---|---:|---:|---:|---:|---:|---|\n";
  for (const auto& section : report.sections) {
    const auto counts = count(section.checks);
    out += fmt::format("| {} | {} | {} | {} | {} | {:.1f} | {} |\n", section.name, counts.kept,
                       counts.missed, counts.failed, counts.measured, section.seconds,
                       section.state_hash == 0 ? "" : fmt::format("{:016x}", section.state_hash));
  }
  for (const auto& section : report.sections) {
    if (section.checks.empty()) continue;
    out += fmt::format(
        "\n## {}\n\n`{}`, compared with: {}.\n\n"
        "| check | reference | ours | error | bound | source of the bound | |\n"
        "|---|---|---|---:|---:|---|---|\n",
        section.title, section.name, section.source);
    for (const auto& check : section.checks)
      out += fmt::format("| {} | {} | {} | {} | {} | {} | {} |\n",
                         check.name.substr(section.name.size() + 1), md_cell(check.expected),
                         md_cell(check.ours), check.has_bound ? size_of(check, check.error) : "",
                         check.has_bound ? size_of(check, check.bound.value) : "",
                         check.has_bound ? md_cell(check.bound.words()) : "",
                         name_of(check.verdict()));
    const auto first = std::ranges::find_if(
        section.parts, [](const auto& part) { return std::holds_alternative<plot::Plot>(part); });
    if (first != section.parts.end())
      out += fmt::format("\n![{}]({})\n", std::get<plot::Plot>(*first).title, plot_file(section));
  }
  return out;
}

Status write_file(const std::filesystem::path& path, const std::string& text) {
  std::ofstream out(path, std::ios::binary);
  out << text;
  out.close();
  if (!out)
    return Error{ErrorCode::ResourceMissing, path.string() + ": cannot be written, see --out"};
  return {};
}

}  // namespace trocar::validation
