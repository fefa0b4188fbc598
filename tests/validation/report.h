#pragma once

// What the validation experiments found, and the two files that say it: results.json for programs,
// report.html for people.
//
// A check compares one number of ours with the paper's, with a closed form or with a reference
// solution: its error is never negative and the bound is kept if error <= bound. "At least x" has
// the shortfall as its error and the bound 0. A number that could not be had is NaN: not kept.

#include <filesystem>
#include <string>
#include <variant>
#include <vector>

#include "common/base/result.h"
#include "server/lab/plot/plot.h"

namespace trocar::validation {

struct Check {
  std::string name;      // experiment/what: "choi2002/fig5-profiles/optimum"
  std::string expected;  // what the paper, the closed form or the reference says
  std::string ours;
  double error = 0;
  double bound = 0;
  bool is_relative = true;  // people see error and bound in per cent
  std::string note;         // what is compared, in one sentence

  bool is_kept() const { return error <= bound; }
};

struct Table {
  std::string title;
  std::vector<std::string> head;
  std::vector<std::vector<std::string>> rows;
};

// A scenario that the experiment ran. Of a family only the first is printed in full.
struct Scene {
  std::string family, name, text;
};

struct Section {
  std::string name;                                // "choi2002/fig5-profiles"
  std::string title;                               // for people
  std::string source;                              // "Choi 2002, figure 5"
  double seconds = 0;                              // CPU time that it took
  std::uint64_t steps = 0, unconverged_steps = 0;  // of scenarios that are solved to a tolerance
  std::vector<Check> checks;
  using Part = std::variant<std::string, Table, plot::Plot>;  // a string is a paragraph
  std::vector<Part> parts;
  std::vector<Scene> scenes;

  void say(std::string paragraph) { parts.emplace_back(std::move(paragraph)); }
  void add(Table table) { parts.emplace_back(std::move(table)); }
  void add(plot::Plot plot) { parts.emplace_back(std::move(plot)); }

  // `what` is the last part of the check's name. |ours - expected| / |expected| at most `bound`.
  void compare(const std::string& what, double expected, double ours, double bound,
               const std::string& unit, const std::string& note);
  // An error measured elsewhere, relative.
  void at_most(const std::string& what, const std::string& expected, double error, double bound,
               const std::string& note);
  void at_least(const std::string& what, const std::string& expected, double ours, double least,
                const std::string& note);
  // Counts and states that are so or are not.
  void exactly(const std::string& what, const std::string& expected, const std::string& ours,
               const std::string& note);
};

struct Report {
  std::string machine;  // processor and compiler
  std::string command;
  std::string date;
  bool is_short = false;
  std::vector<Section> sections;
};

// Four significant digits, as people see numbers.
std::string shown(double value);
std::string shown_percent(double share);

std::string to_json(const std::vector<Section>& sections);
// Error: gnuplot is missing.
Result<std::string> to_html(const Report& report);
Status write_file(const std::filesystem::path& path, const std::string& text);

}  // namespace trocar::validation
