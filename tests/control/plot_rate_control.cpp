// Writes what the controller decides in virtual sessions, as a table and as plots to look at.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>

#include "common/plot/plot.h"
#include "tests/control/virtual_machine.h"

namespace trocar::control {
namespace {

using testing::Load;
using testing::Machine;
using testing::Row;

struct Scene {
  std::string title;
  Machine machine;
  Load load;
  Tick ticks = 10'000;
};

std::map<std::string, Scene> scenes() {
  const auto spikes = [](Tick tick) {
    return tick % 40 == 7 ? 1700.0 : (tick % 40 == 21 ? 700.0 : 0.0);
  };
  Machine tight;
  tight.per_sweep_us = 0.06;
  Machine slowing;
  slowing.per_sweep_us = 0.032;
  return {{"spikes",
           {"five contacts, spikes every 40 ms",
            tight,
            {.contacts = [](Tick) { return 5; }, .spike_us = spikes},
            1000}},
          {"slowing",
           {"a machine that gets twice as slow from 5 s to 15 s and recovers from 25 s to 35 s",
            slowing,
            {.contacts = [](Tick) { return 6; },
             .slowness =
                 [](Tick tick) {
                   const double t = static_cast<double>(tick) * 1e-3;
                   return 1 + std::clamp((t - 5) / 10, 0.0, 1.0) -
                          std::clamp((t - 25) / 10, 0.0, 1.0);
                 }},
            45'000}},
          {"contacts",
           {"one contact, eight from 2 s to 8 s, sixteen from 4 s to 6 s",
            tight,
            {.contacts =
                 [](Tick tick) {
                   return tick < 2000 || tick >= 8000 ? 1 : (tick >= 4000 && tick < 6000 ? 16 : 8);
                 }},
            20'000}}};
}

Status write_table(const std::filesystem::path& file, const std::vector<Row>& rows) {
  std::ofstream out(file);
  out << "tick,time_us,contacts,sweeps_touched,sweeps_1,sweeps_2,sweeps_deep,node_limit,"
         "queue_nodes,node_sweeps,work_us,predicted_us,budget_us,slow_ticks,level\n";
  for (const auto& r : rows)
    out << r.tick << ',' << r.time_us << ',' << r.contacts << ',' << r.sweeps[0] << ','
        << r.sweeps[1] << ',' << r.sweeps[2] << ',' << r.sweeps[3] << ',' << r.node_limit << ','
        << r.queue_nodes << ',' << r.node_sweeps << ',' << r.work_us << ',' << r.predicted_us << ','
        << r.budget_us << ',' << r.slow_ticks << ',' << wire::name_of(r.level) << '\n';
  out.close();
  if (!out) return Error{ErrorCode::ResourceMissing, file.string() + ": cannot be written"};
  return {};
}

template <typename Value>
plot::Series series(const std::string& name, const std::vector<Row>& rows, std::size_t every,
                    Value&& value) {
  plot::Series series{.name = name};
  for (std::size_t i = 0; i < rows.size(); i += every) {
    series.x.push_back(static_cast<double>(rows[i].tick) * 1e-3);
    series.y.push_back(value(rows[i]));
  }
  return series;
}

Status write_plots(const std::filesystem::path& folder, const std::string& name, const Scene& scene,
                   const std::vector<Row>& with, const std::vector<Row>& without) {
  const auto every = std::max<std::size_t>(1, with.size() / 5000);
  const auto work = [](const Row& row) { return row.work_us; };
  plot::Plot time{.title = scene.title,
                  .x = {.label = "simulated time (s)"},
                  .y = {.label = "tick (us)", .low = 0}};
  time.series = {series("fixed decisions", without, every, work),
                 series("controlled", with, every, work),
                 series("budget", with, every, [](const Row& row) { return row.budget_us; }),
                 series("predicted", with, every, [](const Row& row) { return row.predicted_us; })};
  if (auto s = plot::write_svg(folder / (name + "-time.svg"), time); !s) return s;

  plot::Plot decided{.title = scene.title,
                     .x = {.label = "simulated time (s)"},
                     .y = {.label = "sweeps per tick", .low = 0, .high = 5}};
  const char* const layers[] = {"touched nodes", "layer 1", "layer 2", "layer 3 and deeper"};
  for (std::size_t layer = 0; layer < step::kSweepLayers; ++layer)
    // Apart, so that equal counts do not hide each other.
    decided.series.push_back(series(layers[layer], with, every, [layer](const Row& row) {
      return row.sweeps[layer] - 0.04 * static_cast<double>(layer);
    }));
  return plot::write_svg(folder / (name + "-decisions.svg"), decided);
}

int run(int argc, char** argv) {
  std::string out = "out/rate-control";
  CLI::App app("Virtual sessions with injected tick costs: what the rate controller decides.",
               "plot_rate_control");
  app.footer("Example:\n  plot_rate_control --out out/rate-control");
  app.add_option("--out", out, "folder for tables (.csv) and plots (.svg)")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  std::error_code error;
  std::filesystem::create_directories(out, error);
  const auto limits = testing::roomy_limits();
  for (const auto& [name, scene] : scenes()) {
    const auto with = run_virtual(scene.machine, scene.load, scene.ticks, limits);
    const auto without = run_virtual(scene.machine, scene.load, scene.ticks, limits, false);
    Status written = write_table(std::filesystem::path(out) / (name + ".csv"), with);
    if (written.ok()) written = write_plots(out, name, scene, with, without);
    if (!written) return report("plot_rate_control", written.error());
    std::printf(
        "%-9s ticks within 1 ms: %5.1f %% fixed, %5.1f %% controlled; given up: %llu, %llu; "
        "changes of direction %d\n",
        name.c_str(), 100 * testing::kept_share(without, 0, scene.ticks),
        100 * testing::kept_share(with, 0, scene.ticks),
        static_cast<unsigned long long>(without.back().slow_ticks),
        static_cast<unsigned long long>(with.back().slow_ticks),
        testing::direction_changes(with, 0, scene.ticks));
  }
  return 0;
}

}  // namespace
}  // namespace trocar::control

int main(int argc, char** argv) {
  return trocar::control::run(argc, argv);
}
