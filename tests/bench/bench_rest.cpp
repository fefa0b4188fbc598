// This program measures ticks in which nobody touches the tissue, without a network: after a blade
// was waved in the liver or swung about in it by an ordinary hand, after minutes of cutting, and
// while a free piece falls; and ticks in which a finger presses far from old wounds. It prints
// medians of thread CPU time by stage beside those of the uncut organ; the state hash says that it
// is the same work.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <cstdio>

#include "common/base/program.h"
#include "common/math/box.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/tissue/step/simulation.h"
#include "tests/step/cut_rest.h"

namespace trocar {
namespace {

constexpr const char* kProgram = "bench_rest";

struct Options {
  std::vector<std::string> scenes{"swing", "cuts", "wave", "wound", "minutes", "fall"};
  std::string organ = "elastic-liver";
  float gravity_m_s2 = 0;
  double swing_s = 15, swing_m_s = 0.4;
  bool is_measured = false;
  double wave_s = 15, minutes = 1, fall_s = 1;
  int wounds = 5, seeds = 1;
};

Box<float> box_of(const organ::Organ& organ) {
  Box<float> box;
  for (const auto& p : organ.mesh.rest_positions) box.include(to_float(p));
  return box;
}

// Ticks of one stretch of a session.
struct Stretch {
  std::array<std::vector<std::uint32_t>, step::kStageCount> stages;
  std::vector<std::uint32_t> totals;
  double active = 0, pairs = 0;

  void add(const step::TickReport& report) {
    std::uint32_t total = 0;
    for (std::size_t s = 0; s < stages.size(); ++s) {
      stages[s].push_back(report.stage_cpu_ns[s]);
      total += report.stage_cpu_ns[s];
    }
    totals.push_back(total);
    active += report.near.active_nodes;
    pairs += report.contact.self_pairs;
  }
};

double part_us(std::vector<std::uint32_t> ns, double share) {
  std::ranges::sort(ns);
  return ns.empty() ? 0 : 1e-3 * ns[static_cast<std::size_t>(share * double(ns.size() - 1))];
}

void print(const char* title, const Stretch& stretch) {
  const auto count = static_cast<double>(std::max<std::size_t>(1, stretch.totals.size()));
  const auto stage = [&](step::Stage s) {
    return part_us(stretch.stages[static_cast<std::size_t>(s)], 0.5);
  };
  std::printf(
      "  %-28s tick %6.0f p99 %6.0f worst %6.0f us: contacts %5.0f queue %4.0f solve %5.0f hash "
      "%3.0f; %4.0f active nodes, %4.0f pairs\n",
      title, part_us(stretch.totals, 0.5), part_us(stretch.totals, 0.99),
      part_us(stretch.totals, 1), stage(step::Stage::Contacts), stage(step::Stage::Queue),
      stage(step::Stage::Solve), stage(step::Stage::Hash), stretch.active / count,
      stretch.pairs / count);
}

class Session {
 public:
  explicit Session(organ::Organ organ, float edge_m = 0.12f)
      : box_(box_of(organ)), simulation_(std::move(organ)) {
    hands::HandJoin join{.slot = {0}};
    join.shapes[0] = {.radius_m = 0.001f, .length_m = 0.3f, .edge_m = edge_m};
    inputs_.joins.push_back(join);
    join.slot = {1};
    join.shapes[0] = {.radius_m = 0.008f, .length_m = 0.3f};
    inputs_.joins.push_back(join);
  }

  const step::Simulation& simulation() const { return simulation_; }
  const Box<float>& box() const { return box_; }

  void put(const Vec3f& tip, tool::Verb verb, std::uint8_t hand = 0) {
    inputs_.samples.push_back({tool_slot({hand}, 0), {{tip, rotation_from_z({0, 1, 0})}, verb}});
  }
  const step::TickReport& tick() {
    const auto& report = simulation_.tick(inputs_, simulation_.with_sweeps_for_organ({}));
    inputs_.clear();
    simulation_.pop_frame();
    return report;
  }
  Stretch run(double seconds) {
    Stretch stretch;
    for (int i = 0; i < static_cast<int>(1000 * seconds); ++i) stretch.add(tick());
    return stretch;
  }
  // A finger presses the top at this x, once a second 10 mm deep.
  Stretch press(float x, double seconds) {
    Vec3f top = box_.least;
    for (const auto& p : simulation_.state().world.rest_positions)
      if (std::abs(p.x - x) < 0.01f && p.y > top.y) top = p;
    Stretch stretch;
    for (int i = 0; i < static_cast<int>(1000 * seconds); ++i) {
      const auto turn = static_cast<float>(std::sin(M_PI * 1e-3 * i));
      const float depth = 0.01f * turn * turn - 0.008f;
      if (i % 4 == 0) put(top - Vec3f{0, depth, 0}, tool::Verb::Push, 1);
      stretch.add(tick());
    }
    put({0, 0.5f, 0}, tool::Verb::None, 1);
    return stretch;
  }
  // A stroke of 4 cm at 5 cm/s, and then nothing, in 3 s.
  Stretch stroke(const Vec3f& middle, const Vec3f& way) {
    Stretch stretch;
    for (int i = 0; i < 3000; ++i) {
      const float along = 0.05f * static_cast<float>(i) * 1e-3f - 0.02f;
      if (i % 4 == 0 && i < 800) put(middle + way * along, tool::Verb::Cut);
      if (i == 800) put({0, 0.5f, 0}, tool::Verb::None);
      stretch.add(tick());
    }
    return stretch;
  }
  void end() {
    const auto& topology = simulation_.state().cuts.topology();
    std::printf("  %zu nodes, %zu tets, %zu surface vertices, hash %016" PRIx64 "\n",
                topology.node_count(), topology.tet_count(), simulation_.layout().vertex_count(),
                simulation_.state_hash());
    std::fflush(stdout);
  }

 private:
  Box<float> box_;
  step::Simulation simulation_;
  hands::TickInputs inputs_;
};

organ::Organ liver(const Options& options) {
  auto organ = options.is_measured ? catalogue::make_measured_liver() : catalogue::make_liver();
  return std::move(*organ);
}

// Ten random cuts in organs that nobody tuned for.
void cuts(const Options& options) {
  std::printf("ten random cuts, then nobody touches\n");
  for (int organ = 0; organ < step::testing::kLawOrgans; ++organ)
    for (int load = 0; load < step::testing::kRestLoads; ++load)
      for (int seed = 1; seed <= options.seeds; ++seed) {
        const auto rest = step::testing::run_cut_rest(
            organ, static_cast<step::testing::RestLoad>(load), static_cast<unsigned>(seed));
        std::printf(
            "  %-48s %6zu tets, asleep after %5d ms, fastest %7.2f mm/s, %.1e J, tick %5.0f us, "
            "hash %016" PRIx64 "\n",
            rest.name.c_str(), rest.tets, rest.asleep_after, 1e3 * rest.motion.fastest_m_s,
            rest.motion.kinetic_j, rest.tick_us, rest.hash);
        std::fflush(stdout);
      }
}

// The tip goes to and fro along x at 25 cm/s while it wanders slowly along z.
Vec3f wave(const Box<float>& box, double seconds, double wander_hz) {
  const auto turn = [](double phase) { return static_cast<float>(std::sin(2 * M_PI * phase)); };
  const Vec3f mid = (box.least + box.most) * 0.5f, half = (box.most - box.least) * 0.5f;
  return mid + Vec3f{half.x * 0.6f * turn(seconds * 0.6), half.y * 0.2f * turn(seconds * 0.31),
                     half.z * 0.7f * turn(seconds * wander_hz)};
}

void wave(const Options& options) {
  std::printf("a blade is waved for %.0f s, then nobody touches\n", options.wave_s);
  Session session(liver(options));
  session.run(0.2);
  print("uncut", session.run(0.5));
  const int ticks = static_cast<int>(options.wave_s * 1000);
  for (int i = 0; i < ticks; ++i) {
    if (i % 4 == 0) session.put(wave(session.box(), i * 1e-3, 0.23), tool::Verb::Cut);
    session.tick();
  }
  session.put({0, 0.5f, 0}, tool::Verb::None);
  session.run(1);
  print("1 s after the blade", session.run(1));
  session.run(2);
  print("4 s after the blade", session.run(1));
  session.end();
}

// The default instrument goes about in the organ as fast as a mouse, and then is gone.
void swing(const Options& options) {
  std::printf("%s: an ordinary blade swings at %.1f m/s for %.0f s, then nobody touches\n",
              options.organ.c_str(), options.swing_m_s, options.swing_s);
  auto loaded = catalogue::load_organ(options.organ);
  if (!loaded) return void(std::printf("  %s\n", loaded.error().message.c_str()));
  auto organ = std::move(*loaded);
  if (options.gravity_m_s2 > 0) organ.gravity_m_s2 = {0, -options.gravity_m_s2, 0};
  Session session(std::move(organ), tool::ToolShape{}.edge_m);
  const auto& box = session.box();
  const Vec3f middle = (box.least + box.most) * 0.5f, size = box.most - box.least;
  const Vec3f reach{0.22f * size.x, 0.22f * size.y, 0.1f * size.z};
  session.run(0.2);
  print("uncut", session.run(0.5));
  const double per_s = options.swing_m_s / (0.8 * static_cast<double>(reach.x));
  Stretch last;
  for (int i = 0; i < static_cast<int>(options.swing_s * 1000); ++i) {
    const double phase = per_s * 1e-3 * i;
    const auto turn = [&](double times) { return static_cast<float>(std::cos(times * phase)); };
    if (i % 8 == 0)
      session.put(
          middle + Vec3f{reach.x * turn(1), reach.y * std::sin(1.37f * static_cast<float>(phase)),
                         reach.z * std::sin(0.71f * static_cast<float>(phase))},
          tool::Verb::Cut);
    const auto& report = session.tick();
    if (i + 1000 >= static_cast<int>(options.swing_s * 1000)) last.add(report);
  }
  print("the last second of it", last);
  session.put({0, 0.5f, 0}, tool::Verb::None);
  int asleep_after = -1;
  Stretch rest;
  for (int i = 1; i <= 3000; ++i) {
    rest.add(session.tick());
    const auto motion = step::testing::motion_of(session.simulation().state().world);
    if (motion.is_asleep && asleep_after < 0) asleep_after = i;
    if (i % 1000 != 0) continue;
    print("a second of rest", rest);
    std::printf("    kinetic energy %.1e J, fastest node %.2f mm/s\n", motion.kinetic_j,
                1e3 * motion.fastest_m_s);
    rest = {};
  }
  if (asleep_after < 0)
    std::printf("  never asleep\n");
  else
    std::printf("  asleep after %d ms\n", asleep_after);
  session.end();
}

// Strokes at one end of the organ; then a finger presses at the other.
void wound(const Options& options) {
  std::printf("a finger presses far from %d wounds\n", options.wounds);
  Session session(liver(options));
  const auto& box = session.box();
  const Vec3f size = box.most - box.least;
  const float pressed_x = box.least.x + 0.3f * size.x;
  session.run(0.2);
  print("uncut, pressed", session.press(pressed_x, 2));
  session.run(1);
  for (int i = 0; i < options.wounds; ++i) {
    const float z = (static_cast<float>(i) + 0.5f) / static_cast<float>(options.wounds);
    session.stroke(box.least + Vec3f{size.x * 0.7f, 0.6f * size.y, size.z * (0.2f + 0.6f * z)},
                   {1, 0, 0});
  }
  session.run(1);
  print("at rest", session.run(0.5));
  print("cut, pressed", session.press(pressed_x, 2));
  session.end();
}

// Strokes 2 cm deep, one each 3 s at places all over the organ.
void minutes(const Options& options) {
  std::printf("one cutter for %.1f minutes\n", options.minutes);
  Session session(liver(options));
  session.run(0.2);
  print("uncut", session.run(0.5));
  const auto& box = session.box();
  print("uncut, pressed", session.press(0.5f * (box.least.x + box.most.x), 2));
  session.run(1);
  const int strokes = static_cast<int>(options.minutes * 20);
  for (int stroke = 0; stroke < strokes; ++stroke) {
    const float a = std::fmod(static_cast<float>(stroke) * 0.618034f, 1.0f),
                b = std::fmod(static_cast<float>(stroke) * 0.754877f, 1.0f);
    const Vec3f size = box.most - box.least;
    const Vec3f place =
        box.least + Vec3f{size.x * (0.15f + 0.7f * a), 0.6f * size.y, size.z * (0.15f + 0.7f * b)};
    const float angle = 2.39996f * static_cast<float>(stroke);
    const auto during = session.stroke(place, {std::cos(angle), 0, std::sin(angle)});
    if ((stroke + 1) % 20 == 0) {
      char title[64];
      std::snprintf(title, sizeof title, "minute %d", (stroke + 1) / 20);
      print(title, during);
    }
  }
  session.run(1);
  print("1 s after", session.run(1));
  print("while a finger presses", session.press(0.5f * (box.least.x + box.most.x), 2));
  session.end();
}

// The lower part of the liver, cut off level, under gravity.
void fall(const Options& options) {
  std::printf("a piece is cut off and falls for %.1f s\n", options.fall_s);
  auto organ = liver(options);
  organ.gravity_m_s2 = {0, -9.81, 0};
  Session session(std::move(organ), 0.2f);
  const auto& box = session.box();
  const auto lowest = [&] {
    const auto& world = session.simulation().state().world;
    NodeIndex found(0);
    for (const auto node : world.surface_nodes)
      if (world.position(node).y < world.position(found).y) found = node;
    return found;
  };
  session.run(0.2);
  print("uncut", session.run(0.5));
  // The edge stands upright at one x and sweeps through that end along z.
  const float x = box.least.x + 0.8f * (box.most.x - box.least.x);
  const int ticks = static_cast<int>(10 * 1000 * (box.most.z - box.least.z + 0.04f));
  Stretch falling;
  float fastest = 0;
  const auto watch = [&] {
    const auto& report = session.tick();
    const auto& world = session.simulation().state().world;
    const auto node = lowest();
    const float y = world.position(node).y, speed = -world.velocities[node.value].y;
    if (y > box.least.y - 0.06f || speed < 0.01f) return;
    falling.add(report);
    fastest = std::max(fastest, speed);
  };
  for (int i = 0; i < ticks; ++i) {
    if (i % 4 == 0)
      session.put({x, box.least.y - 0.08f, box.least.z - 0.02f + 1e-4f * static_cast<float>(i)},
                  tool::Verb::Cut);
    watch();
  }
  session.put({0, 0.5f, 0}, tool::Verb::None);
  for (int i = 0; i < static_cast<int>(1000 * options.fall_s); ++i) watch();
  print("while the piece falls", falling);
  print("then", session.run(0.2));
  const auto& world = session.simulation().state().world;
  std::printf("  it fell for %zu ms, at %.2f m/s at last; its lowest node is at %.3f m, %.3f m/s\n",
              falling.totals.size(), static_cast<double>(fastest),
              static_cast<double>(world.position(lowest()).y),
              static_cast<double>(world.velocities[lowest().value].y));
  session.end();
}

}  // namespace
}  // namespace trocar

int main(int argc, char** argv) {
  using namespace trocar;
  begin_program(kProgram);
  Options options;
  CLI::App app{"CPU time of ticks in which cut tissue is at rest", kProgram};
  app.add_option("scenes", options.scenes, "swing, cuts, wave, wound, minutes, fall")
      ->capture_default_str()
      ->check(CLI::IsMember({"swing", "cuts", "wave", "wound", "minutes", "fall"}));
  app.add_option("--organ", options.organ, "organ that a blade swings in")->capture_default_str();
  app.add_option("--gravity", options.gravity_m_s2, "on that organ, m/s^2")->capture_default_str();
  app.add_option("--seeds", options.seeds, "of random cuts")->capture_default_str();
  app.add_option("--swing", options.swing_s, "s of swinging")->capture_default_str();
  app.add_option("--speed", options.swing_m_s, "of swinging, m/s")->capture_default_str();
  app.add_flag("--measured", options.is_measured, "the measured liver, not the elastic one");
  app.add_option("--wave", options.wave_s, "s of waving")->capture_default_str();
  app.add_option("--minutes", options.minutes, "of cutting")->capture_default_str();
  app.add_option("--wounds", options.wounds, "strokes of the scene wound")->capture_default_str();
  app.add_option("--fall", options.fall_s, "s of falling")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  for (const auto& scene : options.scenes) {
    if (scene == "swing") swing(options);
    if (scene == "cuts") cuts(options);
    if (scene == "wave") wave(options);
    if (scene == "wound") wound(options);
    if (scene == "minutes") minutes(options);
    if (scene == "fall") fall(options);
  }
}
