// Blades in the session's own tick, without a network: each goes through the organ from end to end
// with its edge upright, lifts, and goes through it again beside that. CPU time of the tick's cut
// stage (cutting, and everything that follows the new topology), in ticks that changed it, and of
// finding contacts. With --thrown hands do what none does: each blade, or each second one a tip
// that pushes, is thrown to a random place so far away, each frame.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cinttypes>
#include <cstdio>

#include "common/base/program.h"
#include "common/math/box.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/tissue/step/simulation.h"
#include "tests/bench/session_clock.h"
#include "tests/bench/thrown_hands.h"

namespace trocar {
namespace {

constexpr const char* kProgram = "bench_cuts";
constexpr int kBuiltInTets = 88'000;
constexpr step::TickDecisions kFixed{.far_interval = 3};
constexpr float kBeside_m = 0.009f, kBeyond_m = 0.01f;

struct Options {
  std::string organ, law;
  double seconds = 10, speed = 0.1, edge_mm = 120, thrown_mm = 0, leave_s = 1e9;
  int blades = 1;
  bool has_tips = false, prints_seconds = false, is_controlled = false;
  unsigned workers = 1;
};

Box<float> box_of(const organ::Organ& organ) {
  Box<float> box;
  for (const auto& p : organ.mesh.rest_positions) box.include(to_float(p));
  return box;
}

tool::ToolSample sample_of(const Box<float>& box, const Options& options, std::uint8_t blade,
                           Tick tick) {
  const float length = box.most.x - box.least.x + 2 * kBeyond_m;
  const float gone = static_cast<float>(tick) * 1e-3f * static_cast<float>(options.speed) +
                     0.3f * length * static_cast<float>(blade);
  const auto stroke = static_cast<int>(gone / length);
  const float along = gone - length * static_cast<float>(stroke);
  const float depth = box.most.z - box.least.z;
  const int place = stroke + 3 * blade, places = std::max(1, static_cast<int>(depth / kBeside_m));
  const float aside = kBeside_m * (static_cast<float>(place % places) + 0.5f);
  const bool is_between = along < kBeyond_m / 2;  // lifted from one end to the other
  const Vec3f tip{box.least.x - kBeyond_m + along, 0.6f * box.least.y + 0.4f * box.most.y,
                  box.least.z + aside};
  return {{tip, rotation_from_z({0, 1, 0})}, is_between ? tool::Verb::None : tool::Verb::Cut};
}

double part(const std::vector<double>& sorted, double share) {
  return sorted.empty()
             ? 0
             : sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))];
}

// Joins hands and says where they are in each tick.
class Hands {
 public:
  Hands(const Box<float>& box, const Options& options)
      : box_(box), options_(options), thrown_(box, static_cast<float>(1e-3 * options.thrown_mm)) {}

  void join(hands::TickInputs& inputs) const {
    for (std::uint8_t b = 0; b < options_.blades; ++b) {
      hands::HandJoin join{.slot = {b}, .tool_count = options_.has_tips ? 2 : 1};
      join.shapes[0] = {.radius_m = 0.001f,
                        .length_m = 0.3f,
                        .edge_m = static_cast<float>(1e-3 * options_.edge_mm)};
      inputs.joins.push_back(join);
    }
  }
  void move(Tick tick, hands::TickInputs& inputs) {
    const bool is_thrown = options_.thrown_mm > 0;
    if (tick % (is_thrown ? kTicksPerFrame : 4) != 1) return;
    const bool has_left = static_cast<double>(tick) > 1000 * options_.leave_s;
    for (std::uint8_t b = 0; b < options_.blades; ++b) {
      auto sample = is_thrown ? tool::ToolSample{thrown_.next(tool_slot({b}, 0)), tool::Verb::Cut}
                              : sample_of(box_, options_, b, tick);
      if (has_left) sample = {{box_.most * 2.0f, {}}, tool::Verb::None};
      inputs.samples.push_back({tool_slot({b}, 0), sample});
      if (!options_.has_tips) continue;
      const auto tip = tool_slot({b}, 1);
      inputs.samples.push_back({tip, {thrown_.next(tip), tool::Verb::Push}});
    }
  }

 private:
  Box<float> box_;
  const Options& options_;
  bench::ThrownHands thrown_;
};

// Says what ticks took and did.
struct Ticks {
  std::vector<double> cut_us, all_us, contacts_us;
  std::uint32_t most_pairs = 0;
  double sum_cut_us = 0, sum_us = 0, area_m2 = 0;
  std::uint64_t crossed = 0, splits = 0, behind = 0;

  void add(const step::TickReport& report) {
    const auto stage_us = [&](step::Stage stage) {
      return report.stage_cpu_ns[static_cast<std::size_t>(stage)] * 1e-3;
    };
    double all = 0;
    for (const auto ns : report.stage_cpu_ns) all += ns * 1e-3;
    all_us.push_back(all);
    sum_us += all;
    contacts_us.push_back(stage_us(step::Stage::Contacts));
    most_pairs = std::max(most_pairs, report.contact.self_pairs);
    const auto& cut = report.cut;
    sum_cut_us += stage_us(step::Stage::Cut);
    if (cut.splits > 0 || cut.opened_area_m2 > 0) cut_us.push_back(stage_us(step::Stage::Cut));
    area_m2 += cut.opened_area_m2;
    crossed += cut.crossed_tets;
    splits += cut.splits;
    behind += cut.is_behind;
  }
};

void print_distribution(const char* what, std::vector<double>& us) {
  std::ranges::sort(us);
  std::printf("  %s: median %.0f, p99 %.0f, worst %.0f us\n", what, part(us, 0.5), part(us, 0.99),
              part(us, 1));
}

void run(organ::Organ organ, const Options& options) {
  const std::string name = organ.name;
  Hands hands(box_of(organ), options);
  step::Simulation simulation(std::move(organ), options.workers);
  const auto& topology = simulation.state().cuts.topology();
  const auto nodes_before = topology.node_count(), tets_before = topology.tet_count();
  hands::TickInputs inputs;
  hands.join(inputs);
  Ticks ticks;
  double second_us = 0;
  bench::SessionClock clock(simulation);
  Tick slow_before = 0;
  for (Tick tick = 1; tick <= static_cast<Tick>(options.seconds * 1000); ++tick) {
    hands.move(tick, inputs);
    const auto& report =
        simulation.tick(inputs, options.is_controlled ? clock.decisions() : kFixed);
    ticks.add(report);
    clock.pass(simulation, report);
    inputs.clear();
    if (!options.prints_seconds || tick % 1000 != 0) continue;
    const auto slow = static_cast<double>(clock.slow_ticks() - slow_before);
    std::printf("  second %2.0f: %.2f s of CPU, time at %.2f of real time\n",
                static_cast<double>(tick) * 1e-3, 1e-6 * (ticks.sum_us - second_us),
                1000 / (1000 + slow));
    std::fflush(stdout);
    slow_before = clock.slow_ticks();
    second_us = ticks.sum_us;
  }
  std::printf("%s, %d blade(s) at %.0f cm/s, %.0f s, hash %016" PRIx64 "\n", name.c_str(),
              options.blades, 100 * options.speed, options.seconds, simulation.state_hash());
  std::printf("  nodes %zu -> %zu, tets %zu -> %zu, wound %.1f cm2, %" PRIu64
              " tets crossed, %" PRIu64 " splits, behind in %" PRIu64 " ticks\n",
              nodes_before, topology.node_count(), tets_before, topology.tet_count(),
              1e4 * ticks.area_m2, ticks.crossed, ticks.splits, ticks.behind);
  std::printf("  %.1f us of cut stage per crossed tet; up to %u pairs of tissue; %.2f s of CPU\n",
              ticks.sum_cut_us / static_cast<double>(std::max<std::uint64_t>(1, ticks.crossed)),
              ticks.most_pairs, 1e-6 * ticks.sum_us);
  print_distribution(
      ("cut stage in " + std::to_string(ticks.cut_us.size()) + " ticks that cut").c_str(),
      ticks.cut_us);
  print_distribution("contacts", ticks.contacts_us);
  print_distribution("whole tick", ticks.all_us);
}

}  // namespace
}  // namespace trocar

int main(int argc, char** argv) {
  using namespace trocar;
  begin_program(kProgram);
  Options options;
  CLI::App app{"cost of cutting in a session's tick", kProgram};
  app.add_option("--organ", options.organ, ".organ or .msh file [the built-in liver, 88,000 tets]");
  app.add_option("--law", options.law, "springs or neo-hookean [as the organ has]")
      ->check(CLI::IsMember({"springs", "neo-hookean"}));
  app.add_option("--seconds", options.seconds, "simulated")->capture_default_str();
  app.add_option("--speed", options.speed, "of the blades, m/s")->capture_default_str();
  app.add_option("--blades", options.blades)->capture_default_str()->check(CLI::Range(1, 8));
  app.add_option("--edge", options.edge_mm, "of the blades, mm")->capture_default_str();
  app.add_option("--thrown", options.thrown_mm, "hands are thrown so far, each frame; mm");
  app.add_flag("--tips", options.has_tips, "each hand has a tip that is thrown, too");
  app.add_option("--leave", options.leave_s, "blades lift and go after so many seconds");
  app.add_flag("--each-second", options.prints_seconds, "tells what each second took");
  app.add_flag("--controlled", options.is_controlled,
               "decide as a session does whose only load this is, from CPU time; no equal hashes");
  app.add_option("--workers", options.workers)->capture_default_str()->check(CLI::Range(1, 64));
  CLI11_PARSE(app, argc, argv);
  auto organ = options.organ.empty() ? catalogue::make_liver(kBuiltInTets)
                                     : catalogue::load_organ(options.organ);
  if (!organ) return report(kProgram, organ.error());
  if (!options.law.empty())
    organ->material.elastic_law =
        options.law == "springs" ? material::ElasticLaw::Springs : material::ElasticLaw::NeoHookean;
  run(std::move(*organ), options);
}
