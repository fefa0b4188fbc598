// Blades in the session's own tick, without a network: each goes through the organ from end to end
// with its edge upright, lifts, and goes through it again beside that. CPU time of the tick's cut
// stage (cutting, and everything that follows the new topology), in ticks that changed it, and of
// finding contacts.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cinttypes>
#include <cstdio>

#include "common/base/cpu.h"
#include "common/math/box.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/tissue/step/simulation.h"

namespace trocar {
namespace {

constexpr const char* kProgram = "bench_cuts";
constexpr int kBuiltInTets = 88'000;
constexpr float kBeside_m = 0.009f, kBeyond_m = 0.01f;

struct Options {
  std::string organ, law;
  double seconds = 10, speed = 0.1;
  int blades = 1;
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

void run(organ::Organ organ, const Options& options) {
  const Box<float> box = box_of(organ);
  const std::string name = organ.name;
  step::Simulation simulation(std::move(organ), options.workers);
  const auto nodes_before = simulation.state().cuts.topology().node_count(),
             tets_before = simulation.state().cuts.topology().tet_count();
  hands::TickInputs inputs;
  for (std::uint8_t b = 0; b < options.blades; ++b) {
    hands::HandJoin join{.slot = {b}};
    join.shapes[0] = {.radius_m = 0.001f, .length_m = 0.3f, .edge_m = 0.12f};
    inputs.joins.push_back(join);
  }
  std::vector<double> cut_us, tick_us, contacts_us;
  std::uint32_t most_pairs = 0;
  double all_cut_us = 0, area_m2 = 0;
  std::uint64_t crossed = 0, splits = 0, behind = 0;
  for (Tick tick = 1; tick <= static_cast<Tick>(options.seconds * 1000); ++tick) {
    for (std::uint8_t b = 0; b < options.blades; ++b)
      if (tick % 4 == 1)
        inputs.samples.push_back({tool_slot({b}, 0), sample_of(box, options, b, tick)});
    const auto& report = simulation.tick(inputs, {.far_interval = 3});
    inputs.clear();
    const double us = report.stage_cpu_ns[static_cast<std::size_t>(step::Stage::Cut)] * 1e-3;
    double all = 0;
    for (const auto ns : report.stage_cpu_ns) all += ns * 1e-3;
    tick_us.push_back(all);
    contacts_us.push_back(report.stage_cpu_ns[static_cast<std::size_t>(step::Stage::Contacts)] *
                          1e-3);
    most_pairs = std::max(most_pairs, report.contact.self_pairs);
    all_cut_us += us;
    if (report.cut.splits > 0 || report.cut.opened_area_m2 > 0) cut_us.push_back(us);
    area_m2 += report.cut.opened_area_m2;
    crossed += report.cut.crossed_tets;
    splits += report.cut.splits;
    behind += report.cut.is_behind;
  }
  std::ranges::sort(cut_us);
  std::ranges::sort(tick_us);
  std::ranges::sort(contacts_us);
  const auto& topology = simulation.state().cuts.topology();
  std::printf("%s, %d blade(s) at %.0f cm/s, %.0f s, hash %016" PRIx64 "\n", name.c_str(),
              options.blades, 100 * options.speed, options.seconds, simulation.state_hash());
  std::printf("  nodes %zu -> %zu, tets %zu -> %zu, wound %.1f cm2, %" PRIu64
              " tets crossed, %" PRIu64 " splits, behind in %" PRIu64 " ticks\n",
              nodes_before, topology.node_count(), tets_before, topology.tet_count(), 1e4 * area_m2,
              crossed, splits, behind);
  std::printf(
      "  cut stage in %zu ticks that cut: median %.0f, p99 %.0f, worst %.0f us; %.1f us per "
      "crossed tet\n",
      cut_us.size(), part(cut_us, 0.5), part(cut_us, 0.99), part(cut_us, 1),
      all_cut_us / static_cast<double>(std::max<std::uint64_t>(1, crossed)));
  std::printf("  contacts: median %.0f, p99 %.0f, worst %.0f us, up to %u pairs of tissue\n",
              part(contacts_us, 0.5), part(contacts_us, 0.99), part(contacts_us, 1), most_pairs);
  std::printf("  whole tick: median %.0f, p99 %.0f, worst %.0f us\n", part(tick_us, 0.5),
              part(tick_us, 0.99), part(tick_us, 1));
}

}  // namespace
}  // namespace trocar

int main(int argc, char** argv) {
  using namespace trocar;
  require_cpu_features(kProgram);
  Options options;
  CLI::App app{"cost of cutting in a session's tick", kProgram};
  app.add_option("--organ", options.organ, ".organ or .msh file [the built-in liver, 88,000 tets]");
  app.add_option("--law", options.law, "springs or neo-hookean [as the organ has]")
      ->check(CLI::IsMember({"springs", "neo-hookean"}));
  app.add_option("--seconds", options.seconds, "simulated")->capture_default_str();
  app.add_option("--speed", options.speed, "of the blades, m/s")->capture_default_str();
  app.add_option("--blades", options.blades)->capture_default_str()->check(CLI::Range(1, 8));
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
