#pragma once

// A report holds what the validation experiments found. Files say it: results.json and .csv for
// programs; report.html and validation.md, with plots, for people.
//
// A check compares one number of ours with the paper's, with a closed form or with a reference
// solution: its error is never negative and the bound is kept if error <= bound. "At least x" has
// the shortfall as its error and the bound 0. A number that could not be had is NaN: not kept.
//
// Every bound says where it comes from: a law, the paper, or a target of this project. It never
// comes from what was measured. What misses its bound and is known to is declared with the largest
// error on record: the report shows it as missed, and the program fails if the error grows beyond
// the record, or if the bound is kept after all, so that the declaration goes.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/base/result.h"
#include "common/plot/plot.h"

namespace trocar::validation {

enum class Origin : std::uint8_t { Law, Paper, Target };

struct Bound {
  double value = 0;
  Origin origin = Origin::Target;
  std::string source;  // which law, which figure, what the target is for
  std::optional<double>
      largest_missed;  // the error on record of a bound that is known to be missed

  // For at_least() the record is a value, the least that was seen.
  Bound missed(double on_record) const;
  std::string words() const;  // "law: F L / (E A)"
};
Bound law(double value, std::string source);
Bound paper(double value, std::string source);
Bound target(double value, std::string source);

enum class Verdict : std::uint8_t {
  Kept,
  Missed,    // as declared
  Broken,    // not kept and not declared, or worse than on record
  Outdated,  // declared as missed, but kept
  Measured,  // without a bound
};
const char* name_of(Verdict verdict);

struct Check {
  std::string name;      // experiment/what: "choi2002/fig5-profiles/optimum"
  std::string expected;  // what the paper, the closed form or the reference says
  std::string ours;
  double error = 0;
  Bound bound;
  bool is_relative = true;  // people see error and bound in per cent
  std::string note;         // what is compared, in one sentence
  bool has_bound = true;

  bool is_kept() const { return error <= bound.value; }
  Verdict verdict() const;
  bool fails() const { return verdict() == Verdict::Broken || verdict() == Verdict::Outdated; }
};

struct Counts {
  std::size_t kept = 0, missed = 0, failed = 0, measured = 0;
};
Counts count(const std::vector<Check>& checks);

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
  std::uint64_t state_hash = 0;                    // of where its scenarios ended
  std::vector<Check> checks;
  using Part = std::variant<std::string, Table, plot::Plot>;  // a string is a paragraph
  std::vector<Part> parts;
  std::vector<std::string> svgs;  // its plots in order, once draw() has been called
  std::vector<Scene> scenes;

  void say(std::string paragraph) { parts.emplace_back(std::move(paragraph)); }
  void add(Table table) { parts.emplace_back(std::move(table)); }
  void add(plot::Plot plot) { parts.emplace_back(std::move(plot)); }

  // `what` is the last part of the check's name. |ours - expected| / |expected| at most `bound`.
  void compare(const std::string& what, double expected, double ours, Bound bound,
               const std::string& unit, const std::string& note);
  // An error measured elsewhere, relative.
  void at_most(const std::string& what, const std::string& expected, double error, Bound bound,
               const std::string& note);
  // The bound is the least.
  void at_least(const std::string& what, const std::string& expected, double ours, Bound least,
                const std::string& note);
  // Counts and states that are so or are not.
  void exactly(const std::string& what, const std::string& expected, const std::string& ours,
               Bound bound, const std::string& note);
  // Adds a figure that is worth a row and has nothing to be held against.
  void measured(const std::string& what, const std::string& ours, const std::string& note);
  // Draws the plots. Error: gnuplot is missing.
  Status draw();
  // A row if a step did not reach its tolerance; after the last step.
  void check_convergence();
};

struct Report {
  std::string processor, compiler, commit;
  double load_before = 0, load_after = 0;  // one-minute averages of the machine
  std::string command;
  std::string date;
  bool is_short = false;
  std::vector<Section> sections;
};

// "12 bounds kept, 3 missed as declared, 1 broken, 4 figures without a bound"
std::string totals(const std::vector<Section>& sections);

// Four significant digits, as people see numbers.
std::string shown(double value);
std::string shown_percent(double share);

// results.json: a list of checks. run.json: the machine, and each experiment with its time and
// hash.
std::string to_json(const std::vector<Section>& sections);
std::string run_to_json(const Report& report);
std::string to_csv(const std::vector<Section>& sections);
// Returns the file of the first plot, beside the documentation's page: "plots/choi2002-creep.svg".
std::string plot_file(const Section& section);
// Returns the page of the documentation, with the first plot of each section. Sections have been
// drawn, here and below.
std::string to_markdown(const Report& report);
std::string to_html(const Report& report);
Status write_file(const std::filesystem::path& path, const std::string& text);

}  // namespace trocar::validation
