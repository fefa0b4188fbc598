#include "tests/step/cut_rest.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/math/box.h"
#include "server/tissue/step/simulation.h"
#include "tests/support/random.h"

namespace trocar::step::testing {
namespace {

using trocar::testing::Random;

constexpr float kSpeed_m_s = 0.1f;

organ::Organ loaded_organ(int kind, RestLoad load, std::uint64_t seed) {
  auto organ = law_organ(kind, seed);
  organ.material.tension = load == RestLoad::Tension ? 0.04 : 0;
  organ.gravity_m_s2 = load == RestLoad::Gravity ? Vec3d{0, -9.81, 0} : Vec3d{};
  return organ;
}

class Cutting {
 public:
  Cutting(organ::Organ organ, std::uint64_t seed) : random_(seed), simulation_(std::move(organ)) {
    for (const auto& p : simulation_.state().world.rest_positions) box_.include(p);
    hands::HandJoin join{.slot = {0}};
    join.shapes[0] = {};
    inputs_.joins.push_back(join);
  }
  const Simulation& simulation() const { return simulation_; }

  const TickReport& tick() {
    const auto& report = simulation_.tick(inputs_, simulation_.with_sweeps_for_organ({}));
    inputs_.clear();
    simulation_.pop_frame();
    return report;
  }

  // From one place at the organ's faces to another, into the depth.
  void stroke() {
    const Vec3f from = place(), to = place();
    const float way_m = length(to - from);
    const auto ticks = static_cast<int>(1000 * way_m / kSpeed_m_s);
    for (int i = 0; i <= ticks; ++i) {
      if (i % 4 == 0)
        put(from + (to - from) * (static_cast<float>(i) / static_cast<float>(ticks)),
            tool::Verb::Cut);
      tick();
    }
    put(box_.most + Vec3f{0, 0.3f, 0}, tool::Verb::None);
    for (int i = 0; i < 100; ++i) tick();
  }
  void leave() { inputs_.leaves.push_back({0}); }

 private:
  Vec3f place() {
    const auto along = [&](float low, float high) {
      return low + (high - low) * static_cast<float>(random_.between(-0.1, 1.1));
    };
    return {along(box_.least.x, box_.most.x), along(box_.least.y, box_.most.y),
            along(box_.least.z, box_.most.z)};
  }
  void put(const Vec3f& tip, tool::Verb verb) {
    inputs_.samples.push_back({tool_slot({0}, 0), {{tip, rotation_from_z({0, 1, 0})}, verb}});
  }

  Random random_;
  Simulation simulation_;
  hands::TickInputs inputs_;
  Box<float> box_;
};

}  // namespace

Motion motion_of(const world::World& world) {
  Motion motion;
  for (std::size_t n = 0; n < world.node_count(); ++n) {
    if (world.node_classes[n] == world::NodeClass::Fixed) continue;
    const double squared = length_squared(to_double(world.velocities[n]));
    motion.kinetic_j += 0.5 * static_cast<double>(world.masses[n]) * squared;
    motion.fastest_m_s = std::max(motion.fastest_m_s, std::sqrt(squared));
    motion.is_asleep &= world.node_classes[n] == world::NodeClass::Asleep;
  }
  return motion;
}

CutRest run_cut_rest(int organ, RestLoad load, std::uint64_t seed) {
  constexpr const char* kLoads[] = {"no load", "tension", "gravity"};
  Cutting cutting(loaded_organ(organ, load, seed), seed);
  for (int i = 0; i < kRestCuts; ++i) cutting.stroke();
  cutting.leave();
  CutRest rest;
  rest.name = fmt::format("{}, {}, seed {}", law_organ_name(organ),
                          kLoads[static_cast<std::size_t>(load)], seed);
  const auto& world = cutting.simulation().state().world;
  std::vector<double> ticks_us;
  for (int i = 1; i <= kRestTicks; ++i) {
    const auto& report = cutting.tick();
    double us = 0;
    for (const auto ns : report.stage_cpu_ns) us += 1e-3 * ns;
    if (2 * i > kRestTicks) ticks_us.push_back(us);
    if (rest.asleep_after < 0 && motion_of(world).is_asleep) rest.asleep_after = i;
  }
  std::ranges::nth_element(ticks_us, ticks_us.begin() + kRestTicks / 4);
  rest.tick_us = ticks_us[kRestTicks / 4];
  rest.motion = motion_of(world);
  rest.tets = cutting.simulation().state().cuts.topology().tet_count();
  rest.hash = cutting.simulation().state_hash();
  return rest;
}

}  // namespace trocar::step::testing
