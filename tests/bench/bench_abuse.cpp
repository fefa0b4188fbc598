// People who are clumsy or mean no good, in a session's own tick without a network: tips thrown
// about, blades swung, one spot sawn for two minutes, a comb of a hundred cuts, tissue cut while
// others hold or swing it. For each it prints at which part of real time the others' time went,
// while that lasted and two seconds after all tools had left, and what is left of it in memory.
// Ticks are decided as a session does, on a clock of CPU time that has no other load.

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>
#include <string>

#include "common/base/program.h"
#include "common/math/box.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/tissue/step/simulation.h"
#include "tests/bench/resident_memory.h"
#include "tests/bench/session_clock.h"
#include "tests/bench/thrown_hands.h"

namespace trocar {
namespace {

constexpr const char* kProgram = "bench_abuse";
constexpr float kMouseSpeed_m_s = 0.4f;
// Hands are away for so long: time is judged in the second after two of them.
constexpr int kAway_s = 3;
constexpr double kLeastRate = 0.9, kLeastRateAfter = 0.98;

// A scene says where tools are at a time, s. Slots have two tools each.
using Tell = std::function<void(ToolSlot, const Vec3f& tip, tool::Verb)>;
struct Scene {
  const char* name;
  int seconds;
  int hands, tools;  // tools: of each hand
  float edge_m;
  std::function<void(float seconds, const Tell&)> move;
};

// Returns 0 .. 1 .. 0 .. -1 .. 0 in a period of 1.
float swing(float periods) {
  return std::sin(2 * std::numbers::pi_v<float> * periods);
}

Box<float> box_of(const organ::Organ& organ) {
  Box<float> box;
  for (const auto& p : organ.mesh.rest_positions) box.include(to_float(p));
  return box;
}

class Scenes {
 public:
  explicit Scenes(const organ::Organ& organ)
      : box_(box_of(organ)), thrown_(box_, kTicksPerFrame * kTickSeconds) {
    float highest = -INFINITY;
    for (const auto node : organ.mesh.surface_nodes) {
      const Vec3f p = to_float(organ.mesh.rest_positions[node.value]);
      if (p.y > highest) highest = p.y, top_ = p;
    }
  }

  std::vector<Scene> all() {
    return {
        {"16 tips thrown about at 1 m/s", 20, 8, 2, 0,
         [this](float, const Tell& tell) { throw_tips(tell); }},
        {"8 blades at 1 m/s", 20, 8, 1, 0.04f,
         [this](float s, const Tell& tell) { swing_blades(s, tell); }},
        {"sawing in one spot", 120, 1, 1, 0.02f,
         [this](float s, const Tell& tell) { saw(s, tell); }},
        {"100 cuts, 2 mm apart", 100, 1, 1, 0.02f,
         [this](float s, const Tell& tell) { comb(s, tell); }},
        {"cutting a strand that swings", 20, 2, 1, 0.02f,
         [this](float s, const Tell& tell) { cut_strand(s, tell); }},
        {"cutting what another holds", 20, 2, 1, 0.02f,
         [this](float s, const Tell& tell) { cut_held(s, tell); }},
    };
  }

 private:
  void throw_tips(const Tell& tell) {
    for (std::uint8_t i = 0; i < kMaxTools; ++i)
      tell(ToolSlot{i}, thrown_.next(ToolSlot{i}).position, tool::Verb::Push);
  }
  // From end to end, as deep as the middle.
  void swing_blades(float s, const Tell& tell) const {
    const Vec3f size = box_.most - box_.least, middle = (box_.least + box_.most) * 0.5f;
    for (std::uint8_t i = 0; i < 8; ++i) {
      const float along = swing(s / size.x * 0.5f + 0.13f * static_cast<float>(i));
      const float aside = 0.45f * swing(0.031f * s + 0.11f * static_cast<float>(i));
      tell(tool_slot({i}, 0), middle + Vec3f{0.5f * size.x * along, 0, size.z * aside},
           tool::Verb::Cut);
    }
  }
  void saw(float s, const Tell& tell) const {
    constexpr float kReach_m = 0.015f;
    const float along = kReach_m * swing(s * kMouseSpeed_m_s / (4 * kReach_m));
    tell(tool_slot({0}, 0), top_ + Vec3f{along, -0.01f, 0}, tool::Verb::Cut);
  }
  // A stroke of 5 cm takes three quarters of a second, and the way back the rest of one.
  void comb(float s, const Tell& tell) const {
    const float stroke = std::floor(s), part = s - stroke;
    const float along = part < 0.75f ? part / 0.75f : 4 * (1 - part);
    const Vec3f aside{0, 0,
                      0.002f * (std::fmod(stroke, 50.0f) - 25) + 0.001f * std::floor(stroke / 50)};
    const float lift = part < 0.75f ? 0 : 0.04f;
    tell(tool_slot({0}, 0), top_ + aside + Vec3f{0.05f * (along - 0.5f), lift - 0.01f, 0},
         part < 0.75f ? tool::Verb::Cut : tool::Verb::None);
  }
  // One holds, lifts and swings the top; another cuts below it, to and fro.
  void cut_strand(float s, const Tell& tell) const {
    hold(s, {0.02f * swing(2 * s), 0.02f, 0}, tell);
    const float along = 0.04f * swing(0.5f * s);
    tell(tool_slot({1}, 0), top_ + Vec3f{along, -0.012f - 0.001f * s, 0.01f * swing(0.07f * s)},
         s > 1 ? tool::Verb::Cut : tool::Verb::None);
  }
  void cut_held(float s, const Tell& tell) const {
    hold(s, {0, 0.01f, 0}, tell);
    tell(tool_slot({1}, 0), top_ + Vec3f{0.03f * swing(2 * s), 0, 0.01f * swing(0.3f * s)},
         s > 1 ? tool::Verb::Cut : tool::Verb::None);
  }
  void hold(float s, const Vec3f& moved, const Tell& tell) const {
    const float part = std::clamp(s - 0.5f, 0.0f, 1.0f);
    tell(tool_slot({0}, 0), top_ + moved * part, s > 0.2f ? tool::Verb::Grasp : tool::Verb::None);
  }

  Box<float> box_;
  Vec3f top_;
  bench::ThrownHands thrown_;
};

// A second of simulated time took so much.
struct Second {
  double rate = 1;  // of real time
  double tick_us = 0;
};

class Session {
 public:
  Session(const Scene& scene, const organ::Organ& organ)
      : scene_(scene), simulation_(organ), clock_(simulation_) {
    for (std::uint8_t i = 0; i < scene.hands; ++i) {
      hands::HandJoin join{.slot = {i}, .tool_count = scene.tools};
      for (auto& shape : join.shapes)
        shape = {.radius_m = scene.edge_m > 0 ? 0.002f : 0.005f,
                 .length_m = 0.3f,
                 .edge_m = scene.edge_m};
      inputs_.joins.push_back(join);
    }
  }

  // are_here: hands do what the scene says; else they are away.
  Second run(bool are_here) {
    const auto tell = [this](ToolSlot tool, const Vec3f& tip, tool::Verb verb) {
      inputs_.samples.push_back({tool, {{tip, rotation_from_z({0, 1, 0})}, verb}});
    };
    const Tick slow = clock_.slow_ticks();
    double sum_us = 0;
    for (Tick i = 0; i < kTicksPerSecond; ++i) {
      const auto now = simulation_.current_tick();
      if (now % kTicksPerFrame == 0 && are_here)
        scene_.move(static_cast<float>(now) * kTickSeconds, tell);
      else if (now % kTicksPerFrame == 0)
        for_each_tool([&](ToolSlot tool) { tell(tool, {0, 1, 0}, tool::Verb::None); });
      const auto& report = simulation_.tick(inputs_, clock_.decisions());
      inputs_.clear();
      clock_.pass(simulation_, report);
      for (const auto ns : report.stage_cpu_ns) sum_us += ns * 1e-3;
    }
    const auto seconds = static_cast<double>(kTicksPerSecond);
    return {seconds / (seconds + static_cast<double>(clock_.slow_ticks() - slow)),
            sum_us / seconds};
  }
  std::size_t tets() const { return simulation_.state().cuts.topology().tet_count(); }

 private:
  void for_each_tool(const std::function<void(ToolSlot)>& task) const {
    for (std::uint8_t hand = 0; hand < scene_.hands; ++hand)
      for (int tool = 0; tool < scene_.tools; ++tool) task(tool_slot({hand}, tool));
  }

  const Scene& scene_;
  step::Simulation simulation_;
  bench::SessionClock clock_;
  hands::TickInputs inputs_;
};

// share: of the scene's time.
void run(const Scene& scene, const organ::Organ& organ, double share) {
  Session session(scene, organ);
  const int seconds = std::max(1, static_cast<int>(std::lround(scene.seconds * share)));
  double worst = 1, sum_us = 0;
  for (int i = 0; i < seconds; ++i) {
    const auto second = session.run(true);
    worst = std::min(worst, second.rate);
    sum_us += second.tick_us;
  }
  Second after;
  for (int i = 0; i < kAway_s; ++i) after = session.run(false);
  const bool is_kept = worst >= kLeastRate && after.rate >= kLeastRateAfter;
  std::printf("| %s | %d | %.0f | %.2f | %.2f | %.0f | %zu | %.0f | %s |\n", scene.name, seconds,
              sum_us / seconds, worst, after.rate, after.tick_us, session.tets(),
              bench::resident_mb(), is_kept ? "kept" : "MISSED");
  std::fflush(stdout);
}

}  // namespace
}  // namespace trocar

int main(int argc, char** argv) {
  using namespace trocar;
  begin_program(kProgram);
  std::string name = "liver", only;
  double share = 1;
  CLI::App app{"does anybody slow time for the others?", kProgram};
  app.add_option("--organ", name, "as trocar-server takes them")->capture_default_str();
  app.add_option("--only", only, "scenes whose name has this text");
  app.add_option("--share", share, "of each scene's time")
      ->capture_default_str()
      ->check(CLI::Range(0.01, 10.0));
  CLI11_PARSE(app, argc, argv);
  const auto organ = catalogue::load_organ(name);
  if (!organ) return report(kProgram, organ.error());
  std::printf(
      "%s; time at so much of real time, of which at least %.2f and %.2f are wanted\n\n"
      "| scene | s | us a tick | worst second | two seconds after | us a tick then | tets | memory "
      "(MB) | |\n"
      "|---|--:|--:|--:|--:|--:|--:|--:|---|\n",
      name.c_str(), kLeastRate, kLeastRateAfter);
  Scenes scenes(*organ);
  for (const auto& scene : scenes.all())
    if (std::string_view(scene.name).find(only) != std::string_view::npos)
      run(scene, *organ, share);
}
