// Tissue that pauses: it comes to the same rest with far fewer sweeps, gains no energy on the way,
// and goes on to the bit from the world alone.

#include "server/tissue/dynamics/quiet_groups.h"

#include <gtest/gtest.h>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/dynamics/block_descent.h"

namespace trocar::dynamics {
namespace {

constexpr float kQuiet_m_s = 2e-3f;

organ::Organ sagging_liver() {
  auto organ = *catalogue::make_liver(1000);
  organ.material.elastic_law = material::ElasticLaw::NeoHookean;
  organ.material.has_averaged_strain = true;
  organ.gravity_m_s2 = {0, -0.05, 0};  // It sags by some tenths of a millimetre, slowly.
  return organ;
}

struct Session {
  explicit Session(const organ::Organ& o, const world::World& w)
      : organ(o), world(w), solver(organ, world, 1, StrainScheme::Explicit) {
    solver.use_linear_far_field(world);
    plan = solver.far_plan(1e-3f);
  }
  void step(float quiet_m_s) {
    const SolveSettings settings{.far_sweeps = plan.sweeps,
                                 .far_over_relaxation = plan.over_relaxation,
                                 .quiet_m_s = quiet_m_s,
                                 .has_linear_far_field = true};
    ++world.tick;
    sweeps += solver.solve({}, {}, settings, world).far_node_sweeps;
  }
  double energy_j() const {
    double energy = solver.tissue().energy_j(world.displacements);
    for (std::size_t i = 0; i < world.node_count(); ++i) {
      const auto mass = static_cast<double>(world.masses[i]);
      energy += 0.5 * mass * length_squared(to_double(world.velocities[i])) -
                mass * dot(organ.gravity_m_s2, to_double(world.displacements[i]));
    }
    return energy;
  }

  const organ::Organ& organ;
  world::World world;
  BlockDescent solver;
  FarPlan plan;
  std::uint64_t sweeps = 0;
};

double farthest_apart_m(const world::World& a, const world::World& b) {
  double farthest = 0;
  for (std::size_t i = 0; i < a.node_count(); ++i)
    farthest =
        std::max(farthest, static_cast<double>(length(a.displacements[i] - b.displacements[i])));
  return farthest;
}

TEST(QuietGroups, WhatPausesComesToTheSameRestWithoutEnergyFromNothing) {
  const auto organ = sagging_liver();
  const world::World at_rest(organ);
  Session always(organ, at_rest), pausing(organ, at_rest);
  double energy = pausing.energy_j();
  double sag = 0;
  for (int i = 0; i < 12'000; ++i) {
    always.step(0);
    pausing.step(kQuiet_m_s);
    if (i % 64 != 0) continue;
    const double now = pausing.energy_j();
    EXPECT_LE(now, energy + 1e-9) << "step " << i;
    energy = now;
  }
  for (const auto& u : always.world.displacements)
    sag = std::max(sag, static_cast<double>(length(u)));
  EXPECT_GT(sag, 2e-4);
  EXPECT_LT(farthest_apart_m(always.world, pausing.world), 0.02 * sag);
  EXPECT_LT(5 * pausing.sweeps, always.sweeps);
}

TEST(QuietGroups, ASolverThatReadsTheWorldGoesOnToTheBit) {
  const auto organ = sagging_liver();
  Session session(organ, world::World(organ));
  for (int i = 0; i < 300; ++i) session.step(kQuiet_m_s);
  for (int begun = 0; begun < 9; ++begun) {
    session.step(kQuiet_m_s);
    Session other(organ, session.world);
    for (int i = 0; i < 10; ++i) {
      session.step(kQuiet_m_s);
      other.step(kQuiet_m_s);
      ASSERT_EQ(session.world.displacements, other.world.displacements) << begun << ", " << i;
    }
  }
}

}  // namespace
}  // namespace trocar::dynamics
