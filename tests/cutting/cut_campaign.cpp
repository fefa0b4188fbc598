// Random cuts in fresh series, with a table of what became of the mesh and of what has to hold.
//
//   cut_campaign run ORGAN... --cuts 2000 --csv FILE [--part 0 --parts 2]
//   cut_campaign table FILE...
//
// `run` does so many cuts of each organ and adds a line per cut to FILE; series that are there
// already are left out, so that it can go on where it was stopped. `table` reads what all parts
// did. Exit codes: 0, or 1 if something does not hold, 3 if a file cannot be used. An organ is
// what trocar-server takes, or box, regular (a box without jitter), slab.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>

#include "common/base/timing.h"
#include "server/organs/catalogue/load_organ.h"
#include "tests/cutting/campaign_table.h"

namespace trocar::cutting::testing {
namespace {

struct Options {
  std::vector<std::string> organs, tables;
  std::string csv, kind;
  std::uint64_t first = 1, part = 0, parts = 1;
  std::uint64_t cuts = 2000;
  std::uint32_t length = 0;
  bool is_verbose = false;
  CampaignOptions campaign;
};

[[noreturn]] void fail(int code, const std::string& what) {
  std::fprintf(stderr, "cut_campaign: %s\n", what.c_str());
  std::exit(code);
}

organ::Organ load(const std::string& spec) {
  if (spec == "box") return box_organ(12, 12, 12, 0.005);
  if (spec == "regular") return box_organ(12, 12, 12, 0.005, 0);
  if (spec == "slab") return box_organ(24, 2, 24, 0.004);
  auto organ = catalogue::load_organ(spec);
  if (!organ) fail(3, organ.error().message);
  return *organ;
}

std::string name_of_organ(const std::string& spec) {
  return std::filesystem::path(spec).stem().string();
}

void print(const CutRecord& r) {
  std::printf(
      "%s %llu/%u %s: swept %.2f h2, wound %.3f, waiting %.3f, tets %llu, nodes %llu, "
      "pieces %u (%u crumbs), %.0f kB, %.1f deg%s %s\n",
      r.organ.c_str(), static_cast<unsigned long long>(r.series), r.cut,
      name_of(static_cast<CutKind>(r.kind)), r.swept / r.h / r.h,
      r.swept > 0 ? r.wound / r.swept : 0, r.waiting / r.h / r.h,
      static_cast<unsigned long long>(r.tets), static_cast<unsigned long long>(r.nodes), r.pieces,
      r.crumbs, double(r.bytes) / 1e3, r.angle, r.leaves_bridge ? ", a bridge" : "",
      r.broken.c_str());
}

class Campaign {
 public:
  explicit Campaign(const Options& options) : options_(options) {
    if (options.csv.empty()) return;
    if (std::filesystem::exists(options.csv))
      if (const auto status = table_.read(options.csv); !status) fail(3, status.error().message);
    const bool is_new = table_.cuts() == 0;
    csv_.open(options.csv, is_new ? std::ios::out : std::ios::app);
    if (!csv_) fail(3, options.csv + ": cannot be written");
    if (is_new) csv_ << csv_header() << std::flush;
  }

  int run() {
    for (const auto& organ : options_.organs) run(organ);
    return finish(table_);
  }

  static int finish(const CampaignTable& table) {
    std::printf("%s", table.text().c_str());
    const auto broken = table.broken_laws();
    for (const auto& law : broken) std::printf("does not hold: %s\n", law.c_str());
    return broken.empty() ? 0 : 1;
  }

 private:
  void run(const std::string& spec) {
    const auto organ = load(spec);
    const auto name = name_of_organ(spec);
    std::uint64_t cuts = 0;
    for (auto number = options_.first; cuts < options_.cuts; ++number) {
      cuts += series_length(number, options_.campaign);
      if (number % options_.parts == options_.part && !table_.has_series(name, number))
        run(organ, name, number);
      std::fprintf(stderr, "%s: %llu of %llu cuts\n", name.c_str(),
                   static_cast<unsigned long long>(cuts),
                   static_cast<unsigned long long>(options_.cuts));
    }
  }

  void run(const organ::Organ& organ, const std::string& name, std::uint64_t number) {
    Series series(organ, name, number, options_.campaign);
    std::string lines;
    while (!series.is_over()) {
      const auto record = series.next();
      if (options_.is_verbose || !record.broken.empty()) print(record);
      lines += csv_line(record);
      table_.add(record);
    }
    if (csv_.is_open()) csv_ << lines << std::flush;
  }

  const Options& options_;
  CampaignTable table_;
  std::ofstream csv_;
};

int table(const Options& options) {
  CampaignTable table;
  for (const auto& file : options.tables)
    if (const auto status = table.read(file); !status) fail(3, status.error().message);
  return Campaign::finish(table);
}

int main(int argc, char** argv) {
  Options options;
  auto& settings = options.campaign.settings;
  CLI::App app("Random cuts and what becomes of the mesh");
  app.require_subcommand(1);
  auto* const run = app.add_subcommand("run", "cuts organs");
  run->add_option("organs", options.organs, "liver, box, regular, slab, or files")->required();
  run->add_option("--cuts", options.cuts, "of each organ, or a few more");
  run->add_option("--csv", options.csv, "a line per cut; goes on where it ends");
  run->add_option("--first", options.first, "number of the first series");
  run->add_option("--part", options.part, "only every so manyth series");
  run->add_option("--parts", options.parts)->check(CLI::PositiveNumber);
  run->add_option("--length", options.length, "cuts of every series; else 1 to 100");
  run->add_option("--kind", options.kind, "only cuts of this kind");
  run->add_option("--check", options.campaign.check_every, "the laws after every so many cuts")
      ->check(CLI::PositiveNumber);
  run->add_flag("--verbose", options.is_verbose, "print a line per cut");
  run->add_option("--snap", settings.snap);
  run->add_option("--extension", settings.extension_h);
  run->add_option("--length-floor", settings.length_floor_h);
  run->add_option("--debris", settings.debris_tets);
  run->add_option("--debris-volume", settings.debris_volume_h3);
  run->add_option("--whole-volume", settings.whole_volume_h3);
  auto* const table_command = app.add_subcommand("table", "reads what all parts of a run did");
  table_command->add_option("files", options.tables)->required();
  CLI11_PARSE(app, argc, argv);
  if (options.length > 0) options.campaign.shortest = options.campaign.longest = options.length;
  if (!options.kind.empty()) {
    options.campaign.only = cut_kind_of(options.kind);
    if (!options.campaign.only) fail(2, options.kind + ": no such kind of cut");
  }
  return *run ? Campaign(options).run() : table(options);
}

}  // namespace
}  // namespace trocar::cutting::testing

int main(int argc, char** argv) {
  return trocar::cutting::testing::main(argc, argv);
}
