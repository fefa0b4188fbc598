// Measured tissue that relaxes, in the live energies: against the Prony series and the hereditary
// integral.

#include "server/dynamics/relaxation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/dynamics/block_descent.h"
#include "tests/mesh/block_mesh.h"

namespace trocar::dynamics {
namespace {

constexpr double kSide_m = 0.03;

const scene::HyperelasticMaterial& liver() {
  return *scene::find_measured_material("human_liver_nava2008");
}

// A cube of measured liver, free.
scene::Organ measured_cube() {
  scene::Organ organ;
  organ.name = "cube";
  organ.mesh = trocar::testing::block_mesh(2, kSide_m / 2);
  mesh::centre_on_origin(organ.mesh);
  scene::use_measured(liver(), organ.material);
  organ.node_masses_kg = scene::lumped_masses(organ);
  EXPECT_TRUE(scene::validate(organ));
  return organ;
}

using Stretch = std::array<Vec3d, 3>;  // rows

// The cube in a homogeneous deformation that changes with time, step by step.
class Specimen {
 public:
  Specimen()
      : organ_(measured_cube()),
        tissue_(organ_),
        state_(organ_),
        x_(tissue_.groups().slot_count()) {}

  // Moves to F in a step of dt; the force on the face at +x that this takes, N.
  Vec3d step(const Stretch& f, double dt) {
    const auto& groups = tissue_.groups();
    for (Slot slot = 0; slot < x_.size(); ++slot) {
      const auto node = groups.node_at(slot);
      if (!node.is_valid()) continue;
      const Vec3d& p = organ_.mesh.rest_positions[node.value];
      x_[slot] = to_float4(to_float(Vec3d{dot(f[0], p), dot(f[1], p), dot(f[2], p)} - p));
    }
    auto& relaxation = *tissue_.relaxation();
    relaxation.begin_step(static_cast<float>(dt), state_, workers_);
    Vec3d force;
    Scratch scratch;
    for (Group g = 0; g < groups.group_count(); ++g) {
      NodeStep8 step{zero_vec8(), zero_sym_mat8()};
      tissue_.begin_group(g, x_.data(), 0);
      tissue_.add(g, x_.data(), load_group(&x_[g * kLanes]), step, scratch);
      Vec3Lanes gradients;
      store(gradients, step.gradient - tissue_.relaxed_stress()->forces(g, x_.data()));
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const auto node = groups.nodes_of(g)[lane];
        if (node.is_valid() && organ_.mesh.rest_positions[node.value].x > 0.49 * kSide_m)
          force += to_double(gradients.at(lane));
      }
    }
    relaxation.end_step(x_.data(), state_, workers_);
    return force;
  }

 private:
  scene::Organ organ_;
  Tissue tissue_;
  world::RelaxationState state_;
  std::vector<Float4> x_;
  Workers workers_{1};
};

// What is left of a stress that has come evenly within the first `ramp` seconds.
double left_after_ramp(double t, double ramp) {
  double left = 1;
  for (const auto& [weight, tau] : liver().relaxation)
    left -= weight * (1 - std::exp(-(t - ramp) / tau) * (1 - std::exp(-ramp / tau)) * tau / ramp);
  return left;
}

TEST(LiveRelaxation, SmallShearFollowsThePronySeriesAtEachStep) {
  constexpr double kShear = 1e-3;
  for (const double dt : {0.0005, 0.001, 0.005}) {
    Specimen specimen;
    const Stretch f{Vec3d{1, 0, 0}, Vec3d{kShear, 1, 0}, Vec3d{0, 0, 1}};
    // Shear stress at once: 2 C10 times the shear, on the face along x in direction y.
    const double at_once = 2 * liver().coefficients_pa[0] * kShear * kSide_m * kSide_m;
    double worst = 0;
    const int steps = static_cast<int>(20 / dt);
    for (int i = 1; i <= steps; ++i) {
      const double force = specimen.step(f, dt).y;
      // In the step of the jump itself the force lacks what the step takes away: g dt/(2 tau).
      if (i == 1 || (i > 100 && i % 50 != 0)) continue;
      const double expected = at_once * left_after_ramp(i * dt, dt);
      worst = std::max(worst, std::abs(force / expected - 1));
    }
    std::printf("step %.1f ms: at most %.4f %% from the series\n", dt * 1e3, 100 * worst);
    EXPECT_LT(worst, 1e-3) << dt;
  }
}

// Stretched at constant volume to 1.3 times its length in half a second, held, and let back.
double stretch_at(double t) {
  if (t < 0.5) return 1 + 0.6 * t;
  if (t < 1.5) return 1.3;
  return std::max(1.0, 1.3 - 0.3 * (t - 1.5));
}

// Second Piola-Kirchhoff stress along x of the bracket at once; J = 1, so that
// S = 2 [Psi' I - C10 C^-1].
double stress_at_once(double stretch) {
  const double i1 = stretch * stretch + 2 / stretch;
  return 2 * (scene::strain_energy(liver(), i1 - 3).first -
              liver().coefficients_pa[0] / (stretch * stretch));
}

TEST(LiveRelaxation, LargeStretchesMeetTheHereditaryIntegral) {
  constexpr double kDt = 0.001, kEnd = 3;
  Specimen specimen;
  double largest = 0, worst = 0;
  for (int i = 1; i <= static_cast<int>(kEnd / kDt); ++i) {
    const double t = i * kDt, l = stretch_at(t), across = 1 / std::sqrt(l);
    const double force = specimen.step({Vec3d{l, 0, 0}, {0, across, 0}, {0, 0, across}}, kDt).x;
    if (i % 25 != 0) continue;
    double stress = stress_at_once(l);
    for (const auto& [weight, tau] : liver().relaxation) {
      // Simpson's rule, much finer than the steps.
      const int parts = 4 * i;
      double sum = 0;
      for (int k = 0; k <= parts; ++k) {
        const double s = t * k / parts, share = k == 0 || k == parts ? 1 : k % 2 == 1 ? 4 : 2;
        sum += share * std::exp(-(t - s) / tau) * stress_at_once(stretch_at(s));
      }
      stress -= weight / tau * sum * t / (3 * parts);
    }
    const double expected = l * stress * kSide_m * kSide_m;
    largest = std::max(largest, std::abs(expected));
    worst = std::max(worst, std::abs(force - expected));
  }
  std::printf("at most %.4f %% of %.4f N from the integral\n", 100 * worst / largest, largest);
  EXPECT_LT(worst, 2e-3 * largest);
}

TEST(LiveRelaxation, WhatIsNotLoadedDoesNotMoveInAMinute) {
  auto organ = measured_cube();
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
    if (organ.mesh.rest_positions[n].y < -0.49 * kSide_m) organ.fixed_nodes.push_back(NodeIndex(n));
  world::World world(organ);
  BlockDescent solver(organ, world);
  std::vector<NodeIndex> free_nodes;
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
    if (world.node_classes[n] != world::NodeClass::Fixed) free_nodes.push_back(NodeIndex(n));
  const contact::ContactList nothing;
  for (int i = 0; i < 60'000; ++i) solver.solve(nothing, free_nodes, {.sweeps = 1}, world);
  float farthest = 0;
  for (const auto& d : world.displacements) farthest = std::max(farthest, length(d));
  EXPECT_LT(farthest, 1e-6f);
}

TEST(LiveRelaxation, TissueUnderTensionBeginsRelaxed) {
  auto organ = measured_cube();
  organ.material.tension = 0.05;
  world::World world(organ);
  start_relaxed(organ, world);
  Tissue tissue(organ);
  const auto pull = [&](world::RelaxationState& state) {
    const auto& groups = tissue.groups();
    std::vector<Float4> x(groups.slot_count());
    Workers workers(1);
    tissue.relaxation()->take_state();
    tissue.relaxation()->begin_step(0.001f, state, workers);
    double sum = 0;
    Scratch scratch;
    for (Group g = 0; g < groups.group_count(); ++g) {
      NodeStep8 step{zero_vec8(), zero_sym_mat8()};
      tissue.begin_group(g, x.data(), 0);
      tissue.add(g, x.data(), load_group(&x[g * kLanes]), step, scratch);
      Vec3Lanes gradients;
      store(gradients, step.gradient - tissue.relaxed_stress()->forces(g, x.data()));
      for (std::size_t lane = 0; lane < kLanes; ++lane)
        sum += static_cast<double>(length(gradients.at(lane)));
    }
    return sum;
  };
  // With a bulk modulus of nothing only the bracket would pull; it pulls less than at once.
  world::RelaxationState fresh(organ);
  EXPECT_LT(pull(world.relaxation), pull(fresh));
}

}  // namespace
}  // namespace trocar::dynamics
