// Measured tissue that relaxes, in the live energies: against the Prony series and the hereditary
// integral.

#include "server/tissue/dynamics/relaxation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/tissue/dynamics/block_descent.h"
#include "tests/mesh/block_mesh.h"

namespace trocar::dynamics {
namespace {

constexpr double kSide_m = 0.03;

const material::HyperelasticMaterial& liver() {
  return *material::find_measured_material("human_liver_nava2008");
}

// Returns a material that is as stiff as the liver at first and stiffens as Fung's laws do.
material::HyperelasticMaterial exponential() {
  auto material = liver();
  material.name = "exponential";
  material.energy = material::StrainEnergy::Exponential;
  material.coefficients_pa = {liver().coefficients_pa[0]};
  material.exponent = 3;
  return material;
}

// A cube of a measured material, free.
organ::Organ measured_cube(bool is_averaged, const material::HyperelasticMaterial& material,
                           int cells) {
  organ::Organ organ;
  organ.name = "cube";
  organ.mesh = trocar::testing::block_mesh(cells, kSide_m / cells);
  mesh::centre_on_origin(organ.mesh);
  material::use_measured(material, organ.material);
  organ.material.has_averaged_strain = is_averaged;
  organ.node_masses_kg = organ::lumped_masses(organ);
  EXPECT_TRUE(organ::validate(organ));
  return organ;
}

using Stretch = std::array<Vec3d, 3>;  // rows

// Whether strain is averaged: where it is the same everywhere, nothing may depend on that.
class LiveRelaxation : public ::testing::TestWithParam<bool> {};

// Forces of relaxed stress are taken where the tissue is in each step, or as a solver has them:
// where it was when the step before ended, each node that is not near in its turn.
enum class ForcesAre { Exact, AsSolved };

// The cube in a homogeneous deformation that changes with time, step by step.
class Specimen {
 public:
  // Far tissue is advanced in turns.
  Specimen(bool is_averaged, bool is_near, const material::HyperelasticMaterial& material = liver())
      : Specimen(measured_cube(is_averaged, material, 2), is_near, ForcesAre::Exact,
                 StrainScheme::Implicit) {}
  Specimen(organ::Organ organ, bool is_near, ForcesAre forces, StrainScheme scheme)
      : organ_(std::move(organ)),
        forces_are_(forces),
        scheme_(scheme),
        tissue_(organ_, scheme),
        state_(organ_),
        x_(tissue_.groups().slot_count()) {
    for (Group g = 0; g < tissue_.groups().group_count() && is_near; ++g)
      near_.push_back({g, 0xff});
  }

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
    if (auto* const strain = tissue_.nodal_strain())
      for (Group g = 0; g < groups.group_count(); ++g) strain->restart_group(g, x_.data());
    const bool is_explicit = scheme_ == StrainScheme::Explicit;
    for (Group g = 0; g < groups.group_count() && is_explicit; ++g)
      tissue_.update_nodal_stress(g, x_.data());
    for (Group g = 0; g < groups.group_count(); ++g) {
      NodeStep8 step{zero_vec8(), zero_sym_mat8()};
      tissue_.begin_group(g, x_.data(), 0);
      tissue_.add(g, x_.data(), load_group(&x_[g * kLanes]), step);
      if (is_explicit) step.gradient = step.gradient + tissue_.nodal_forces(g).gradient;
      Vec3Lanes gradients;
      if (forces_are_ == ForcesAre::Exact)
        tissue_.relaxed_stress()->refresh({g, 0xff}, x_.data(), state_);
      store(gradients, step.gradient - tissue_.relaxed_stress()->forces(g));
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const auto node = groups.nodes_of(g)[lane];
        if (node.is_valid() && organ_.mesh.rest_positions[node.value].x > 0.49 * kSide_m)
          force += to_double(gradients.at(lane));
      }
    }
    relaxation.end_step(x_.data(), near_, state_, workers_);
    for (Group g = 0; g < groups.group_count() && forces_are_ == ForcesAre::AsSolved; ++g)
      if (!near_.empty() || relaxation.is_turn_of(g, state_.step()))
        tissue_.relaxed_stress()->refresh({g, 0xff}, x_.data(), state_);
    EXPECT_TRUE(is_finite(force));  // the worst of what is not a number is nothing
    return force;
  }

  // Returns the force of relaxed stress on each node. `lanes` is the mask of the lanes that one
  // call refreshes; it is shifted over all lanes of a group.
  std::vector<Vec3f> forces(std::uint8_t lanes) {
    const auto& groups = tissue_.groups();
    for (Group g = 0; g < groups.group_count(); ++g)
      for (std::uint32_t shift = 0; shift < kLanes; ++shift)
        tissue_.relaxed_stress()->refresh({g, static_cast<std::uint8_t>(lanes << shift)}, x_.data(),
                                          state_);
    return {state_.forces().begin(), state_.forces().end()};
  }
  // Forgets all that is not in the state, as a restore does.
  void restart() { tissue_.relaxation()->restart(); }
  RelaxationFigures figures() const { return *tissue_.relaxation_figures(); }
  // Returns the energy above that at rest.
  double energy_j() const {
    std::vector<Vec3f> u(organ_.mesh.node_count());
    const double at_rest = tissue_.energy_j(u);
    for (std::uint32_t n = 0; n < u.size(); ++n)
      u[n] = to_vec3(x_[tissue_.groups().slot_of(NodeIndex(n))]);
    return tissue_.energy_j(u) - at_rest;
  }

 private:
  organ::Organ organ_;
  ForcesAre forces_are_;
  StrainScheme scheme_;
  Tissue tissue_;
  world::RelaxationState state_;
  std::vector<Float4> x_;
  std::vector<GroupLanes> near_;
  Workers workers_{1};
};

// Returns what is left of a stress that has come evenly within the first `ramp` seconds.
double left_after_ramp(double t, double ramp) {
  double left = 1;
  for (const auto& [weight, tau] : liver().relaxation)
    left -= weight * (1 - std::exp(-(t - ramp) / tau) * (1 - std::exp(-ramp / tau)) * tau / ramp);
  return left;
}

TEST_P(LiveRelaxation, SmallShearFollowsThePronySeriesAtEachStep) {
  constexpr double kShear = 1e-3;
  for (const double dt : {0.0005, 0.001, 0.005}) {
    Specimen specimen(GetParam(), true);
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

// Tissue far from what is solved is advanced in turns: it may lag by one.
TEST_P(LiveRelaxation, InTurnsTissueFollowsTheSeriesATurnLateAtMost) {
  constexpr double kShear = 1e-3, kDt = 0.001;
  Specimen specimen(GetParam(), false);
  const Stretch f{Vec3d{1, 0, 0}, Vec3d{kShear, 1, 0}, Vec3d{0, 0, 1}};
  const double at_once = 2 * liver().coefficients_pa[0] * kShear * kSide_m * kSide_m;
  double worst = 0, worst_late = 0;
  for (int i = 1; i <= 20'000; ++i) {
    const double force = specimen.step(f, kDt).y;
    const double off = std::abs(force - at_once * left_after_ramp(i * kDt, kDt)) / at_once;
    worst = std::max(worst, off);
    if (i > 5000) worst_late = std::max(worst_late, off);
  }
  std::printf("in turns: at most %.3f %% of the stress at once, after 5 s %.4f %%\n", 100 * worst,
              100 * worst_late);
  // 8 ms of the fastest relaxation there is, and of what there is after 5 s.
  EXPECT_LT(worst, 9e-3);
  EXPECT_LT(worst_late, 5e-4);
}

// The largest errors of a force in turns, in parts of the largest force.
struct TurnErrors {
  double ramp_end = 0, hold = 0, reversed = 0;
};
// Sheared within `ramp` seconds, held for 40 steps, and sheared back as fast to the other side.
TurnErrors errors_of_turns(const organ::Organ& organ, StrainScheme scheme, double dt, double ramp) {
  constexpr double kShear = 1e-3;
  constexpr int kHold = 40;
  Specimen every(organ, true, ForcesAre::AsSolved, scheme),
      turns(organ, false, ForcesAre::AsSolved, scheme);
  const int n = static_cast<int>(std::lround(ramp / dt));
  TurnErrors errors;
  double largest = 0;
  for (int i = 1; i <= 3 * n + kHold; ++i) {
    const double shear = kShear * (i <= n           ? static_cast<double>(i) / n
                                   : i <= n + kHold ? 1
                                                    : 1 - static_cast<double>(i - n - kHold) / n);
    const Stretch f{Vec3d{1, 0, 0}, Vec3d{shear, 1, 0}, Vec3d{0, 0, 1}};
    const double right = every.step(f, dt).y, off = std::abs(turns.step(f, dt).y - right);
    largest = std::max(largest, std::abs(right));
    if (i == n) errors.ramp_end = off;
    if (i > n + kHold / 2 && i <= n + kHold) errors.hold = std::max(errors.hold, off);
    if (i > n + kHold) errors.reversed = std::max(errors.reversed, off);
  }
  return {errors.ramp_end / largest, errors.hold / largest, errors.reversed / largest};
}

TEST_P(LiveRelaxation, ForcesInTurnsAreOnAverageThoseOfEveryStep) {
  const auto organ = measured_cube(GetParam(), liver(), 8);
  for (const auto scheme : {StrainScheme::Implicit, StrainScheme::Explicit}) {
    const bool is_explicit = scheme == StrainScheme::Explicit;
    if (is_explicit && !GetParam()) continue;
    for (const double dt : {0.0005, 0.001})
      for (const double ramp : {0.01, 0.02, 0.05, 0.1}) {
        const auto errors = errors_of_turns(organ, scheme, dt, ramp);
        std::printf(
            "%s, step %.1f ms, ramp of %3.0f ms: its end %.3f %%, held %.3f %%, back %.3f %%\n",
            is_explicit ? "explicit" : "implicit", dt * 1e3, ramp * 1e3, 100 * errors.ramp_end,
            100 * errors.hold, 100 * errors.reversed);
        // Nodes that wait a turn too know little of what comes within little more than a turn.
        const bool is_sudden = !is_explicit && ramp < 12 * dt;
        EXPECT_LT(errors.ramp_end, is_sudden ? 2.5e-3 : 1e-3);
        EXPECT_LT(errors.hold, 1e-3);
        EXPECT_LT(errors.reversed, is_sudden ? 2e-3 : 1e-3);
      }
  }
}

TEST_P(LiveRelaxation, ForcesInTurnsFollowFromTheStateAlone) {
  const Stretch f{Vec3d{1.2, 0.1, 0}, {0.05, 0.9, 0}, {0, -0.1, 0.95}};
  Specimen goes_on(GetParam(), false), restored(GetParam(), false);
  for (int i = 0; i < 40; ++i) {
    if (i > 20) restored.restart();
    EXPECT_EQ(goes_on.step(f, 0.001), restored.step(f, 0.001)) << i;
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
double stress_at_once(const material::HyperelasticMaterial& material, double stretch) {
  const double i1 = stretch * stretch + 2 / stretch;
  return 2 * (material::strain_energy(material, i1 - 3).first -
              material.coefficients_pa[0] / (stretch * stretch));
}

void expect_hereditary_integral(bool is_averaged, const material::HyperelasticMaterial& material) {
  constexpr double kDt = 0.001, kEnd = 3;
  Specimen specimen(is_averaged, true, material);
  double largest = 0, worst = 0;
  for (int i = 1; i <= static_cast<int>(kEnd / kDt); ++i) {
    const double t = i * kDt, l = stretch_at(t), across = 1 / std::sqrt(l);
    const double force = specimen.step({Vec3d{l, 0, 0}, {0, across, 0}, {0, 0, across}}, kDt).x;
    if (i % 25 != 0) continue;
    double stress = stress_at_once(material, l);
    for (const auto& [weight, tau] : material.relaxation) {
      // Simpson's rule, much finer than the steps.
      const int parts = 4 * i;
      double sum = 0;
      for (int k = 0; k <= parts; ++k) {
        const double s = t * k / parts, share = k == 0 || k == parts ? 1 : k % 2 == 1 ? 4 : 2;
        sum += share * std::exp(-(t - s) / tau) * stress_at_once(material, stretch_at(s));
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

TEST_P(LiveRelaxation, LargeStretchesMeetTheHereditaryIntegral) {
  expect_hereditary_integral(GetParam(), liver());
}
TEST_P(LiveRelaxation, LargeStretchesOfAnExponentialLawMeetTheHereditaryIntegral) {
  expect_hereditary_integral(GetParam(), exponential());
}

TEST_P(LiveRelaxation, FiguresForPeopleAreThoseOfTheTissue) {
  for (const auto& material : {liver(), exponential()}) {
    Specimen specimen(GetParam(), false, material);
    const Stretch f{Vec3d{1.2, 0.1, 0}, {0.05, 0.9, 0}, {0, -0.1, 0.95}};
    const double growth = dot(f[0], cross(f[1], f[2])) - 1;
    double weights = 0;
    for (const auto& term : liver().relaxation) weights += term.weight;
    for (int i = 0; i < 16; ++i) specimen.step(f, 0.001);
    const auto soon = specimen.figures();
    EXPECT_NEAR(soon.energy_j / specimen.energy_j(), 1, 1e-5);
    EXPECT_NEAR(soon.volume_change, growth, 1e-6);
    EXPECT_LT(soon.relaxed_share, 0.02);
    for (int i = 0; i < 60'000; ++i) specimen.step(f, 0.001);
    const auto late = specimen.figures();
    EXPECT_NEAR(late.energy_j, soon.energy_j, 1e-9);
    EXPECT_NEAR(late.relaxed_share, weights, 1e-3);
  }
}

TEST_P(LiveRelaxation, ForcesOfANodeDoNotDependOnWhichOthersAreTaken) {
  Specimen specimen(GetParam(), true);
  for (int i = 0; i < 50; ++i)
    specimen.step({Vec3d{1.2, 0.1, 0}, {0.05, 0.9, 0}, {0, -0.1, 0.95}}, 0.001);
  const auto together = specimen.forces(0xff), few = specimen.forces(0x05),
             alone = specimen.forces(0x01);
  double largest = 0;
  for (std::size_t n = 0; n < together.size(); ++n) {
    EXPECT_EQ(together[n], few[n]);
    EXPECT_EQ(together[n], alone[n]);
    largest = std::max(largest, static_cast<double>(length(together[n])));
  }
  EXPECT_GT(largest, 0.01);
}

TEST_P(LiveRelaxation, WhatIsNotLoadedDoesNotMoveInAMinute) {
  auto organ = measured_cube(GetParam(), liver(), 2);
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
  for (const auto& d : world.displacements) {
    ASSERT_TRUE(is_finite(d));
    farthest = std::max(farthest, length(d));
  }
  EXPECT_LT(farthest, 1e-6f);
}

TEST_P(LiveRelaxation, TissueUnderTensionBeginsRelaxed) {
  auto organ = measured_cube(GetParam(), liver(), 2);
  organ.material.tension = 0.05;
  world::World world(organ);
  start_relaxed(organ, world);
  Tissue tissue(organ);
  const auto pull = [&](world::RelaxationState& state) {
    const auto& groups = tissue.groups();
    std::vector<Float4> x(groups.slot_count());
    Workers workers(1);
    if (auto* const strain = tissue.nodal_strain())
      for (Group g = 0; g < groups.group_count(); ++g) strain->restart_group(g, x.data());
    tissue.relaxation()->restart();
    tissue.relaxation()->begin_step(0.001f, state, workers);
    double sum = 0;
    for (Group g = 0; g < groups.group_count(); ++g) {
      NodeStep8 step{zero_vec8(), zero_sym_mat8()};
      tissue.begin_group(g, x.data(), 0);
      tissue.add(g, x.data(), load_group(&x[g * kLanes]), step);
      Vec3Lanes gradients;
      tissue.relaxed_stress()->refresh({g, 0xff}, x.data(), state);
      store(gradients, step.gradient - tissue.relaxed_stress()->forces(g));
      for (std::size_t lane = 0; lane < kLanes; ++lane)
        sum += static_cast<double>(length(gradients.at(lane)));
    }
    return sum;
  };
  // Stretched evenly by l from where it has no stress: P = 2 (Psi' l - C10 l^2), of which the
  // series takes its weights away, and K (J - 1) l^2, of which nothing. All nodal forces are as P.
  world::RelaxationState fresh(organ);
  const double l = 1 / (1 - organ.material.tension), i1 = 3 * l * l;
  const double bracket =
      2 * (material::strain_energy(liver(), i1 - 3).first * l - liver().coefficients_pa[0] * l * l);
  const double volumetric = liver().bulk_modulus_pa * (l * l * l - 1) * l * l;
  double weights = 0;
  for (const auto& term : liver().relaxation) weights += term.weight;
  const double at_once = pull(fresh), after = pull(world.relaxation);
  EXPECT_NEAR((at_once - after) / at_once, weights * bracket / (bracket + volumetric), 1e-4);
  EXPECT_GT((at_once - after) / at_once, 0.01);
}

INSTANTIATE_TEST_SUITE_P(, LiveRelaxation, ::testing::Bool(), [](const auto& tested) {
  return tested.param ? "NodalHyperelastic" : "PlainTets";
});

}  // namespace
}  // namespace trocar::dynamics
