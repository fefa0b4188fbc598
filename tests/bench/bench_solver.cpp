// Measures the solver: beside another library, against the targets, how it grows, and what a tick's
// parts cost. deploy/bench runs it.

#include <benchmark/benchmark.h>

#include <CLI/CLI.hpp>
#include <cstdio>

#include "common/base/program.h"
#include "common/base/version.h"
#include "tests/bench/bench_run.h"
#include "tests/bench/bullet_peer.h"

namespace trocar::bench {
namespace {

constexpr const char* kProgram = "bench_solver";
constexpr const char* kExamples = R"(
Examples:
  bench_solver --short --out out/bench
      everything, in minutes; bench.json, bench.csv, bench.md and columns for plots in out/bench
  bench_solver --filter '^peers/W1'
      the plate only, by Bullet and by us
  bench_solver --list
      the names that --filter selects from

Times are CPU time of one thread. A row's hash is that of the state after its last step: equal
hashes mean that the same work was done.
)";

struct Options {
  Scale scale = Scale::Full;
  std::string out, filter = ".", commit = "unknown";
  bool lists = false;
};

int run(const Options& options) {
  Suite suite;
  suite.scale = options.scale;
  Machine machine = this_machine();
  machine.peer_version = BulletPeer::version();
  machine.commit = options.commit;

  std::vector<std::string> arguments{kProgram, "--benchmark_filter=" + options.filter};
  if (options.lists) arguments.push_back("--benchmark_list_tests=true");
  if (!options.out.empty()) {
    std::error_code error;
    std::filesystem::create_directories(options.out, error);
    arguments.push_back("--benchmark_out=" + options.out + "/google-benchmark.json");
    arguments.push_back("--benchmark_out_format=json");
  }
  std::vector<char*> argv;
  for (auto& argument : arguments) argv.push_back(argument.data());
  int argc = static_cast<int>(argv.size());
  benchmark::Initialize(&argc, argv.data());

  add_peers(suite);
  add_targets(suite);
  add_queue(suite);
  add_growth(suite);
  if (benchmark::RunSpecifiedBenchmarks() == 0)
    return report(kProgram, {ErrorCode::Usage, "--filter: '" + options.filter +
                                                   "' matches no benchmark, see --list"});
  if (options.lists) return 0;

  machine.load_after = load_average();
  std::printf("\n%s", suite.results.markdown(machine).c_str());
  if (options.out.empty()) return 0;
  if (auto status = suite.results.write(options.out, machine); !status)
    return report(kProgram, status.error());
  std::printf("\nWritten to %s: bench.json, bench.csv, bench.md, plots/*.dat\n",
              options.out.c_str());
  return 0;
}

}  // namespace
}  // namespace trocar::bench

int main(int argc, char** argv) {
  using namespace trocar::bench;
  trocar::begin_program(kProgram);
  Options options;
  bool is_short = false, is_smoke = false;
  CLI::App app("Measures the solver: beside Bullet, against the targets, and how it grows.",
               kProgram);
  app.footer(kExamples);
  app.set_version_flag("--version", std::string(kProgram) + " " + trocar::kVersion +
                                        ", sim_version " + std::to_string(trocar::kSimVersion));
  app.add_flag("--short", is_short, "fewer steps: minutes instead of a quarter of an hour");
  app.add_flag("--smoke", is_smoke,
               "tiny objects, seconds: shows that everything runs, no figures");
  app.add_option("--out", options.out, "folder for the results; without, they are only shown");
  app.add_option("--filter", options.filter, "regular expression: only what matches");
  app.add_option("--commit", options.commit, "of the source, for the results");
  app.add_flag("--list", options.lists, "name what --filter selects, and run nothing");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const int code = app.exit(error);
    return code == 0 ? 0 : static_cast<int>(trocar::ExitCode::Usage);
  }
  if (is_short) options.scale = Scale::Short;
  if (is_smoke) options.scale = Scale::Smoke;
  return run(options);
}
