// Springs: gradient and block against finite differences of the energy, invariance, dissipation.

#include "server/dynamics/spring_network.h"

#include <gtest/gtest.h>

#include <random>

#include "common/math/frame.h"
#include "common/scene/builtin_organs.h"

namespace trocar::dynamics {
namespace {

scene::Organ small_lattice() {
  auto organ = scene::make_lattice({.nx = 4, .ny = 4, .nz = 4});
  EXPECT_TRUE(organ.ok());
  return *organ;
}

std::vector<Vec3f> random_displacements(std::size_t count, float amplitude, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(-amplitude, amplitude);
  std::vector<Vec3f> u(count);
  for (auto& v : u) v = {uniform(random), uniform(random), uniform(random)};
  return u;
}

struct Linearised {
  Vec3f gradient;
  SymMat3f block;
};

Linearised linearise(const SpringNetwork& network, NodeIndex node, const std::vector<Vec3f>& u,
                     const std::vector<Vec3f>& start, float inverse_dt) {
  std::vector<SpringNetwork::StepTerms> terms(network.batch_count());
  Linearised out;
  out.block = network.prepare_step(node, start, inverse_dt, terms);
  network.add_gradient_and_block(node, u, terms, out.gradient, out.block);
  return out;
}

Vec3f gradient(const SpringNetwork& network, NodeIndex node, const std::vector<Vec3f>& u,
               const std::vector<Vec3f>& start, float inverse_dt) {
  return linearise(network, node, u, start, inverse_dt).gradient;
}

TEST(SpringNetwork, GradientIsTheDerivativeOfTheEnergy) {
  const auto organ = small_lattice();
  const SpringNetwork network(organ);
  for (std::uint32_t seed = 1; seed <= 5; ++seed) {
    auto u = random_displacements(organ.mesh.node_count(), 0.003f, seed);
    for (std::uint32_t n = 0; n < organ.mesh.node_count(); n += 7) {
      const auto g = gradient(network, NodeIndex(n), u, u, 0);
      const float h = 2e-5f;
      const auto slope = [&](float Vec3f::*axis) {
        const float kept = u[n].*axis;
        u[n].*axis = kept + h;
        const double plus = network.elastic_energy(u);
        const double step_up = static_cast<double>(u[n].*axis);
        u[n].*axis = kept - h;
        const double minus = network.elastic_energy(u);
        const double step_down = static_cast<double>(u[n].*axis);
        u[n].*axis = kept;
        return (plus - minus) / (step_up - step_down);
      };
      EXPECT_NEAR(g.x, slope(&Vec3f::x), 2e-4);
      EXPECT_NEAR(g.y, slope(&Vec3f::y), 2e-4);
      EXPECT_NEAR(g.z, slope(&Vec3f::z), 2e-4);
    }
  }
}

TEST(SpringNetwork, BlockIsTheDerivativeOfTheGradientWhereSpringsAreStretched) {
  const auto organ = small_lattice();
  const SpringNetwork network(organ);
  // A uniform stretch keeps every spring longer than its rest length, where nothing is clamped.
  auto u = random_displacements(organ.mesh.node_count(), 0.0003f, 3);
  for (std::size_t i = 0; i < u.size(); ++i) u[i] += to_float(organ.mesh.rest_positions[i]) * 0.2f;
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); n += 5) {
    const SymMat3f block = linearise(network, NodeIndex(n), u, u, 0).block;
    const float h = 1e-4f;
    const auto column = [&](float Vec3f::*axis) {
      auto plus = u, minus = u;
      plus[n].*axis += h;
      minus[n].*axis -= h;
      return (gradient(network, NodeIndex(n), plus, plus, 0) -
              gradient(network, NodeIndex(n), minus, minus, 0)) /
             (plus[n].*axis - minus[n].*axis);
    };
    const Vec3f x = column(&Vec3f::x), y = column(&Vec3f::y), z = column(&Vec3f::z);
    const float tolerance = 0.002f * (block.xx + block.yy + block.zz);
    EXPECT_NEAR(block.xx, x.x, tolerance);
    EXPECT_NEAR(block.xy, x.y, tolerance);
    EXPECT_NEAR(block.xz, x.z, tolerance);
    EXPECT_NEAR(block.yy, y.y, tolerance);
    EXPECT_NEAR(block.yz, y.z, tolerance);
    EXPECT_NEAR(block.zz, z.z, tolerance);
  }
}

TEST(SpringNetwork, BlocksArePositiveSemiDefiniteUnderAnyDeformation) {
  const auto organ = small_lattice();
  const SpringNetwork network(organ);
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    const auto u = random_displacements(organ.mesh.node_count(), 0.02f, seed);
    for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n) {
      const SymMat3f b = linearise(network, NodeIndex(n), u, u, 1000.0f).block;
      const float scale = b.xx + b.yy + b.zz;
      EXPECT_GE(b.xx * b.yy - b.xy * b.xy, -1e-5f * scale * scale);
      const float determinant = b.xx * (b.yy * b.zz - b.yz * b.yz) -
                                b.xy * (b.xy * b.zz - b.yz * b.xz) +
                                b.xz * (b.xy * b.yz - b.yy * b.xz);
      EXPECT_GE(determinant, -1e-5f * scale * scale * scale);
    }
  }
}

TEST(SpringNetwork, InternalForcesHaveNoNetForceAndNoNetTorque) {
  const auto organ = small_lattice();
  const SpringNetwork network(organ);
  const auto start = random_displacements(organ.mesh.node_count(), 0.004f, 11);
  const auto u = random_displacements(organ.mesh.node_count(), 0.004f, 12);
  for (const float inverse_dt : {0.0f, 1000.0f}) {  // elastic alone, then with damping
    Vec3d force, torque;
    double size = 0;
    for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n) {
      const Vec3d f = -to_double(gradient(network, NodeIndex(n), u, start, inverse_dt));
      force += f;
      torque += cross(organ.mesh.rest_positions[n] + to_double(u[n]), f);
      size += length(f);
    }
    EXPECT_LT(length(force), 1e-6 * size);
    // Damping acts along the directions at the start of the step, elasticity along today's: only
    // alone has it one line of action per spring.
    if (inverse_dt == 0) {
      EXPECT_LT(length(torque), 1e-6 * size);
    }
  }
}

TEST(SpringNetwork, RigidMotionCostsNothing) {
  const auto organ = small_lattice();
  const SpringNetwork network(organ);
  const Pose pose{{0.02f, -0.01f, 0.03f}, rotation_from_z(normalized(Vec3f{1, 2, 3}, {0, 0, 1}))};
  std::vector<Vec3f> u;
  for (const auto& p : organ.mesh.rest_positions) {
    const Vec3f rest = to_float(p);
    u.push_back(pose.apply(rest) - rest);
  }
  EXPECT_LT(network.elastic_energy(u), 1e-11);
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
    EXPECT_LT(length(gradient(network, NodeIndex(n), u, u, 0)), 1e-4f);
}

TEST(SpringNetwork, DampingNeverGivesEnergy) {
  const auto organ = small_lattice();
  const SpringNetwork network(organ);
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    const auto start = random_displacements(organ.mesh.node_count(), 0.003f, seed);
    const auto u = random_displacements(organ.mesh.node_count(), 0.003f, seed + 100);
    double power = 0;  // of the damping forces on the motion start -> u
    for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n) {
      const Vec3f with = gradient(network, NodeIndex(n), u, start, 1000.0f);
      const Vec3f without = gradient(network, NodeIndex(n), u, start, 0.0f);
      power += static_cast<double>(dot(without - with, u[n] - start[n]));
    }
    EXPECT_LE(power, 0.0);
  }
}

}  // namespace
}  // namespace trocar::dynamics
