// The linear far field: its matrices against the energies, and a solver with it against one
// without.

#include "server/tissue/dynamics/linear_far_field.h"

#include <gtest/gtest.h>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/dynamics/block_descent.h"
#include "tests/support/random.h"

namespace trocar::dynamics {
namespace {

using material::ElasticLaw;

organ::Organ liver_of(ElasticLaw law) {
  auto organ = *catalogue::make_liver(3000);
  organ.material.elastic_law = law;
  return organ;
}

std::vector<Float4> random_pose(std::size_t count, float amplitude, std::uint64_t seed) {
  std::vector<Float4> pose;
  pose.reserve(count);
  for (const auto& v : testing::random_vectors(count, amplitude, seed))
    pose.push_back(to_float4(v));
  return pose;
}

class LinearFarField : public ::testing::TestWithParam<ElasticLaw> {};

TEST_P(LinearFarField, MatricesAreTheDerivativesOfTheGradient) {
  const auto organ = liver_of(GetParam());
  const Tissue tissue(organ);
  Linearisation linear(tissue);
  const auto slots = tissue.groups().slot_count();
  const auto pose = random_pose(slots, 0.0004f, 1), change = random_pose(slots, 2e-5f, 2);
  std::vector<Float4> moved(slots);
  for (std::size_t i = 0; i < slots; ++i)
    moved[i] = to_float4(to_vec3(pose[i]) + to_vec3(change[i]));
  class Nobody final : public StiffnessSink {
    void add(const SlotLanes&, const Mat8&) override {}
  } nobody;
  Linearisation::Scratch scratch;
  double largest = 0, worst = 0;
  for (Group g = 0; g < linear.group_count(); ++g) {
    linear.renew(g, pose.data(), scratch);
    const auto gradient = [&](const NodeStep8& step) {
      Vec3Lanes lanes;
      store(lanes, step.gradient);
      return lanes;
    };
    const auto exact_at = [&](const std::vector<Float4>& x) {
      NodeStep8 step{zero_vec8(), zero_sym_mat8()};
      tissue.linearise(g, x.data(), load_group(&x[g * kLanes]), step, nobody);
      return gradient(step);
    };
    NodeStep8 at_pose{zero_vec8(), zero_sym_mat8()}, away = at_pose, shifted = at_pose;
    const std::vector<Float4> none(slots), everywhere(slots, Float4{0.3f, -0.2f, 0.1f, 0});
    linear.add(g, none.data(), zero_vec8(), at_pose);
    linear.add(g, change.data(), load_group(&change[g * kLanes]), away);
    linear.add(g, everywhere.data(), load_group(&everywhere[g * kLanes]), shifted);
    const auto before = exact_at(pose), after = exact_at(moved);
    const auto g0 = gradient(at_pose), g1 = gradient(away), same = gradient(shifted);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      ASSERT_EQ(g0.at(lane), before.at(lane));
      ASSERT_EQ(same.at(lane), before.at(lane)) << "a uniform motion changes nothing";
      const Vec3d expected = to_double(after.at(lane)) - to_double(before.at(lane));
      largest = std::max(largest, length(expected));
      worst = std::max(worst, length(to_double(g1.at(lane)) - to_double(g0.at(lane)) - expected));
    }
  }
  EXPECT_GT(largest, 1e-4);
  EXPECT_LT(worst, (GetParam() == ElasticLaw::TensorMass ? 0.002 : 0.02) * largest);
}

INSTANTIATE_TEST_SUITE_P(Laws, LinearFarField,
                         ::testing::Values(ElasticLaw::Springs, ElasticLaw::TensorMass,
                                           ElasticLaw::NeoHookean));

struct Session {
  explicit Session(organ::Organ o) : organ(std::move(o)), world(organ), solver(organ, world) {
    solver.use_linear_far_field(world);
    plan = solver.far_plan(1e-3f);
  }
  SolveReport step(bool is_linear, std::uint32_t interval, const ExternalLoads& loads = {}) {
    const auto far = plan.with_interval(interval);
    const SolveSettings settings{.far_sweeps = far.sweeps,
                                 .far_over_relaxation = far.over_relaxation,
                                 .far_interval = interval,
                                 .has_linear_far_field = is_linear};
    ++world.tick;
    return solver.solve({}, {}, settings, world, loads);
  }
  double energy_j() const {
    double kinetic = 0;
    for (std::size_t i = 0; i < world.node_count(); ++i)
      kinetic += 0.5 * static_cast<double>(world.masses[i]) *
                 length_squared(to_double(world.velocities[i]));
    return kinetic + solver.tissue().energy_j(world.displacements);
  }

  organ::Organ organ;
  world::World world;
  BlockDescent solver;
  FarPlan plan;
};

organ::Organ averaged_liver() {
  auto organ = liver_of(ElasticLaw::NeoHookean);
  organ.material.has_averaged_strain = true;
  return organ;
}

// Whatever the interval and the forces: a body in free flight keeps its velocity, to rounding, and
// falls as it should when something pulls.
TEST(LinearFarField, FreeFlightIsExact) {
  for (const auto& body :
       {liver_of(ElasticLaw::Springs), liver_of(ElasticLaw::NeoHookean), averaged_liver()})
    for (const bool is_linear : {false, true})
      for (const std::uint32_t interval : {1u, 2u, 3u}) {
        auto organ = body;
        organ.fixed_nodes.clear();
        organ.material.node_damping_per_s = 0;
        Session session(organ);
        for (auto& v : session.world.velocities) v = {0.2f, -0.1f, 0.05f};
        session.solver.read_state(session.world);
        for (int i = 0; i < 300; ++i) session.step(is_linear, interval);
        double worst = 0;
        for (const auto& v : session.world.velocities)
          worst = std::max(worst, static_cast<double>(length(v - Vec3f{0.2f, -0.1f, 0.05f})));
        EXPECT_LT(worst, 1e-4) << "interval " << interval << (is_linear ? ", linear" : "");
      }
}

// A blow sets the organ swinging: with matrices it swings as with the energies, and it never gains
// energy.
TEST(LinearFarField, ABlowSwingsAsWithTheEnergies) {
  for (const auto& organ :
       {liver_of(ElasticLaw::Springs), liver_of(ElasticLaw::NeoHookean), averaged_liver()}) {
    Session exact(organ), linear(organ);
    for (auto* session : {&exact, &linear})
      for (std::size_t i = 0; i < session->world.node_count(); ++i)
        if (session->world.node_classes[i] != world::NodeClass::Fixed)
          session->world.velocities[i] = {0.15f, 0, -0.1f};
    for (auto* session : {&exact, &linear}) session->solver.read_state(session->world);
    const double at_start = linear.energy_j();
    const double kinetic = at_start - linear.solver.tissue().energy_j(linear.world.displacements);
    double farthest = 0, apart = 0, most = at_start;
    for (int i = 0; i < 400; ++i) {
      exact.step(false, 1);
      linear.step(true, 1);
      most = std::max(most, linear.energy_j());
      for (std::size_t n = 0; n < exact.world.node_count(); n += 7) {
        const Vec3f u = exact.world.displacements[n];
        farthest = std::max(farthest, static_cast<double>(length(u)));
        apart = std::max(apart, static_cast<double>(length(u - linear.world.displacements[n])));
      }
    }
    EXPECT_GT(farthest, 0.005) << "it swings";
    EXPECT_LT(apart, 0.03 * farthest);
    EXPECT_LT(most - at_start, 1e-3 * kinetic);
  }
}

// Neighbours that part quickly are not linear: their forces come from the energies at once.
TEST(LinearFarField, LargeStrainsBetweenRenewalsAreNotLinear) {
  Session exact(liver_of(ElasticLaw::NeoHookean)), linear(liver_of(ElasticLaw::NeoHookean));
  for (auto* session : {&exact, &linear}) {
    for (std::size_t i = 0; i < session->world.node_count(); ++i) {
      const Vec3f p = session->world.rest_positions[i];
      if (session->world.node_classes[i] != world::NodeClass::Fixed)
        session->world.velocities[i] = Vec3f{-p.y, p.x, 0.5f * p.x} * 30.0f;  // turned and sheared
    }
    session->solver.read_state(session->world);
  }
  double farthest = 0, apart = 0;
  for (int i = 0; i < 60; ++i) {
    exact.step(false, 1);
    linear.step(true, 1);
    for (std::size_t n = 0; n < exact.world.node_count(); ++n) {
      const Vec3f u = exact.world.displacements[n];
      farthest = std::max(farthest, static_cast<double>(length(u)));
      apart = std::max(apart, static_cast<double>(length(u - linear.world.displacements[n])));
    }
  }
  EXPECT_GT(farthest, 0.02);
  EXPECT_LT(apart, 0.05 * farthest);
}

TEST(LinearFarField, RestStaysRest) {
  for (const std::uint32_t interval : {1u, 2u}) {
    Session session(interval == 1 ? averaged_liver() : liver_of(ElasticLaw::NeoHookean));
    for (int i = 0; i < 200; ++i) session.step(true, interval);
    double most = 0;
    for (const auto& u : session.world.displacements)
      most = std::max(most, static_cast<double>(length(u)));
    EXPECT_LT(most, 1e-6);
  }
}

// Sweeps are for the time since the last: half of them a tick, and the organ falls all the same.
TEST(LinearFarField, LongerIntervalsHalveTheSweepsAndFallAsFast) {
  auto organ = liver_of(ElasticLaw::NeoHookean);
  organ.fixed_nodes.clear();
  organ.material.node_damping_per_s = 0;
  organ.gravity_m_s2 = {0, -9.81, 0};
  Session every(organ), second(organ);
  std::uint64_t sweeps_every = 0, sweeps_second = 0;
  for (int i = 0; i < 100; ++i) {
    sweeps_every += every.step(true, 1).node_sweeps;
    sweeps_second += second.step(true, 2).node_sweeps;
  }
  EXPECT_NEAR(static_cast<double>(sweeps_second) / static_cast<double>(sweeps_every), 0.5, 0.02);
  const auto speed = [](const Session& session) {
    double momentum = 0, mass = 0;
    for (std::size_t i = 0; i < session.world.node_count(); ++i) {
      const auto m = static_cast<double>(session.world.masses[i]);
      momentum += m * static_cast<double>(session.world.velocities[i].y);
      mass += m;
    }
    return momentum / mass;
  };
  EXPECT_NEAR(speed(every), -0.981, 0.06);
  EXPECT_NEAR(speed(second), -0.981, 0.12);
}

}  // namespace
}  // namespace trocar::dynamics
