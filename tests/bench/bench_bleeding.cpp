// Measures what bleeding takes: a blade goes through the built-in liver to and fro for some
// seconds, and the wound then bleeds on. CPU time of a frame's blood beside that of its ticks,
// bytes of it in a frame for a client that keeps up, and the hash of the state.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cinttypes>
#include <cstdio>

#include "common/base/program.h"
#include "common/base/timing.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/tissue/step/simulation.h"

namespace trocar {
namespace {

constexpr const char* kProgram = "bench_bleeding";

struct Options {
  std::string organ = "liver";
  double seconds = 20, cutting_s = 5;
  bool is_off = false;
};

double part(std::vector<double>& values, double share) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

tool::ToolSample sample_at(double seconds, double cutting_s) {
  const double stroke = 2.5, t = std::fmod(seconds, stroke) / stroke;
  const auto x = static_cast<float>(-0.04 + 0.08 * t);
  const auto z = static_cast<float>(0.02 * std::floor(seconds / stroke));
  const bool cuts = seconds < cutting_s;
  return {{{x, cuts ? 0.01f : 0.2f, z - 0.01f}, rotation_from_z({0, 1, 0})},
          cuts ? tool::Verb::Cut : tool::Verb::None};
}

void run(organ::Organ organ, const Options& options) {
  step::SceneRules rules;
  if (!options.is_off) rules.bleeding.emplace();
  step::Simulation simulation(std::move(organ), 1, rules);
  hands::TickInputs inputs;
  inputs.joins.push_back({.slot = {0},
                          .tool_count = 1,
                          .shapes = {tool::ToolShape{.radius_m = 0.0015f, .edge_m = 0.06f}, {}}});
  std::vector<double> tick_us, blood_us, bytes, wet;
  wire::BloodLevels before;
  wire::BloodFigures last;
  std::uint64_t hash = 0;
  std::uint32_t crc = 0;
  const auto ticks = static_cast<Tick>(1000 * options.seconds);
  for (Tick tick = 1; tick <= ticks; ++tick) {
    if (tick % 8 == 1)
      inputs.samples.push_back(
          {tool_slot({0}, 0), sample_at(1e-3 * static_cast<double>(tick), options.cutting_s), 0});
    const auto& report = simulation.tick(inputs, simulation.with_sweeps_for_organ({}));
    inputs.clear();
    hash = report.state_hash;
    double all = 0;
    for (const auto ns : report.stage_cpu_ns) all += 1e-3 * static_cast<double>(ns);
    tick_us.push_back(all);
    const auto frame = simulation.pop_frame();
    if (!frame || options.is_off) continue;
    constexpr auto kBleed = static_cast<std::size_t>(step::Stage::Bleed);
    blood_us.push_back(1e-3 * static_cast<double>(report.stage_cpu_ns[kBleed]));
    Bytes delta;
    wire::encode_blood(before, frame->blood, delta);
    before = frame->blood;
    bytes.push_back(static_cast<double>(delta.size()));
    wet.push_back(static_cast<double>(
        std::ranges::count_if(frame->blood, [](auto level) { return level > 0; })));
    last = *frame->figures.blood;
    crc = frame->blood_crc;
  }
  std::printf("%s, %zu surface vertices, %.0f s, cut for %.0f s\n", options.organ.c_str(),
              simulation.layout().vertex_count(), options.seconds, options.cutting_s);
  std::printf("tick: median %.1f us, p99 %.1f us; state hash %016" PRIx64 "\n", part(tick_us, 0.5),
              part(tick_us, 0.99), hash);
  if (options.is_off) return;
  std::printf("blood: median %.1f us a frame (%.2f us a tick), p99 %.1f us; levels %08x\n",
              part(blood_us, 0.5), part(blood_us, 0.5) / kTicksPerFrame, part(blood_us, 0.99), crc);
  std::printf("wet: median %.0f, most %.0f vertices; wire: median %.0f, p99 %.0f bytes a frame\n",
              part(wet, 0.5), part(wet, 1), part(bytes, 0.5), part(bytes, 0.99));
  std::printf("lost %.2f ml, on the organ %.2f ml, dripped %.2f ml\n",
              1e-6 * static_cast<double>(last.shed_nl),
              1e-6 * static_cast<double>(last.on_surface_nl),
              1e-6 * static_cast<double>(last.dripped_nl));
}

}  // namespace
}  // namespace trocar

int main(int argc, char** argv) {
  using namespace trocar;
  begin_program(kProgram);
  Options options;
  CLI::App app{"What bleeding takes, in a tick, in a frame and on the wire.", kProgram};
  app.add_option("--organ", options.organ, "a built-in organ or a file")->capture_default_str();
  app.add_option("--seconds", options.seconds, "simulated")->capture_default_str();
  app.add_option("--cutting", options.cutting_s, "seconds of it with a blade")
      ->capture_default_str();
  app.add_flag("--off", options.is_off, "nothing bleeds, for comparison");
  CLI11_PARSE(app, argc, argv);
  auto organ = catalogue::load_organ(options.organ);
  if (!organ) return report(kProgram, organ.error());
  run(std::move(*organ), options);
}
