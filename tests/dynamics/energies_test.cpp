// Every energy: gradient and block against finite differences, invariance, no net force or torque.

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

#include "common/math/frame.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/dynamics/hyperelastic.h"
#include "server/tissue/dynamics/tissue.h"
#include "tests/mesh/block_mesh.h"
#include "tests/support/random.h"

namespace trocar::dynamics {
namespace {

using material::ElasticLaw;

struct Case {
  const char* name;
  void (*change)(organ::Organ&);
  bool is_linear = false;  // linear elasticity: invariant for small rotations alone
  bool has_stress_at_rest = false;
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.name;
}

organ::Organ block_organ(const Case& c) {
  organ::Organ organ;
  organ.name = "block";
  organ.mesh = trocar::testing::block_mesh(3, 0.01);
  for (std::size_t i = 0; i < organ.mesh.node_count(); ++i)  // no regular directions left
    organ.mesh.rest_positions[i] +=
        Vec3d{double(i * 7 % 11) - 5, double(i * 5 % 13) - 6, double(i * 3 % 7) - 3} * 2e-4;
  organ.mesh.build_adjacency();
  mesh::centre_on_origin(organ.mesh);
  c.change(organ);
  organ.node_masses_kg = organ::lumped_masses(organ);
  const auto status = organ::validate(organ);
  EXPECT_TRUE(status) << (status ? "" : status.error().message);
  return organ;
}

struct Linearised {
  Vec3d gradient;
  std::array<std::array<double, 3>, 3> block;
};

class Probe {
 public:
  explicit Probe(const organ::Organ& organ)
      : tissue_(organ), slots_(tissue_.groups().slot_count()) {}

  Linearised at(NodeIndex node, const std::vector<Vec3f>& u) {
    for (std::uint32_t n = 0; n < u.size(); ++n)
      slots_[tissue_.groups().slot_of(NodeIndex(n))] = to_float4(u[n]);
    for (Group g = 0; g < tissue_.groups().group_count(); ++g)
      if (auto* const strain = tissue_.nodal_strain()) strain->restart_group(g, slots_.data());
    const Slot slot = tissue_.groups().slot_of(node);
    const Group g = slot / kLanes;
    NodeStep8 step{zero_vec8(), zero_sym_mat8()};
    tissue_.begin_group(g, slots_.data(), 0);
    tissue_.add(g, slots_.data(), load_group(&slots_[g * kLanes]), step);
    Vec3Lanes gradient;
    SymMat3Lanes block;
    store(gradient, step.gradient);
    store(block, step.block);
    const SymMat3f b = block.at(slot % kLanes);
    const auto d = [](float v) { return static_cast<double>(v); };
    return {
        to_double(gradient.at(slot % kLanes)),
        {{{d(b.xx), d(b.xy), d(b.xz)}, {d(b.xy), d(b.yy), d(b.yz)}, {d(b.xz), d(b.yz), d(b.zz)}}}};
  }
  double energy(const std::vector<Vec3f>& u) const { return tissue_.energy_j(u); }
  const Tissue& tissue() const { return tissue_; }

 private:
  Tissue tissue_;
  std::vector<Float4> slots_;
};

constexpr float Vec3f::*kAxes[3] = {&Vec3f::x, &Vec3f::y, &Vec3f::z};

class Energies : public ::testing::TestWithParam<Case> {};

TEST_P(Energies, GradientIsTheDerivativeOfTheEnergy) {
  const auto organ = block_organ(GetParam());
  Probe probe(organ);
  for (std::uint32_t seed = 1; seed <= 4; ++seed) {
    auto u = testing::random_vectors(organ.mesh.node_count(), 0.0015f, seed);
    double largest = 0, worst = 0;
    for (std::uint32_t n = seed % 3; n < organ.mesh.node_count(); n += 3) {
      const Vec3d g = probe.at(NodeIndex(n), u).gradient;
      largest = std::max(largest, length(g));
      const double parts[3] = {g.x, g.y, g.z};
      for (int axis = 0; axis < 3; ++axis) {
        const float kept = u[n].*kAxes[axis], h = 2e-5f;
        u[n].*kAxes[axis] = kept + h;
        const double plus = probe.energy(u), up = u[n].*kAxes[axis];
        u[n].*kAxes[axis] = kept - h;
        const double minus = probe.energy(u), down = u[n].*kAxes[axis];
        u[n].*kAxes[axis] = kept;
        worst = std::max(worst, std::abs((plus - minus) / (up - down) - parts[axis]));
      }
    }
    EXPECT_GT(largest, 1e-3) << "the test sees forces";
    EXPECT_LT(worst, 2e-4 * largest) << "seed " << seed;
  }
}

TEST_P(Energies, BlockIsTheDerivativeOfTheGradient) {
  const auto organ = block_organ(GetParam());
  Probe probe(organ);
  // Stretched as a whole, so that springs pull and their blocks are not clamped.
  auto u = testing::random_vectors(organ.mesh.node_count(), 2e-4f, 9);
  for (std::uint32_t n = 0; n < u.size(); ++n)
    u[n] += to_float(organ.mesh.rest_positions[n] * 0.15);
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); n += 5) {
    const auto block = probe.at(NodeIndex(n), u).block;
    const double scale = block[0][0] + block[1][1] + block[2][2];
    ASSERT_GT(scale, 0);
    double difference[3][3];
    for (int axis = 0; axis < 3; ++axis) {
      const float kept = u[n].*kAxes[axis], h = 5e-5f;
      u[n].*kAxes[axis] = kept + h;
      const Vec3d plus = probe.at(NodeIndex(n), u).gradient;
      const double up = u[n].*kAxes[axis];
      u[n].*kAxes[axis] = kept - h;
      const Vec3d minus = probe.at(NodeIndex(n), u).gradient;
      const double down = u[n].*kAxes[axis];
      u[n].*kAxes[axis] = kept;
      const Vec3d slope = (plus - minus) / (up - down);
      const double parts[3] = {slope.x, slope.y, slope.z};
      for (int i = 0; i < 3; ++i)
        difference[i][axis] =
            block[static_cast<std::size_t>(i)][static_cast<std::size_t>(axis)] - parts[i];
    }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        EXPECT_NEAR(difference[i][j], 0, 2e-3 * scale) << "node " << n << " entry " << i << j;
  }
}

TEST_P(Energies, BlocksArePositiveSemiDefiniteUnderAnyDeformation) {
  const auto organ = block_organ(GetParam());
  Probe probe(organ);
  for (const float amplitude : {0.001f, 0.004f, 0.02f}) {  // the last one inverts tets
    const auto u = testing::random_vectors(organ.mesh.node_count(), amplitude, 77);
    for (std::uint32_t n = 0; n < organ.mesh.node_count(); n += 4) {
      const auto b = probe.at(NodeIndex(n), u).block;
      const double trace = b[0][0] + b[1][1] + b[2][2];
      const double minor = b[0][0] * b[1][1] - b[0][1] * b[0][1];
      const double determinant = b[0][0] * (b[1][1] * b[2][2] - b[1][2] * b[1][2]) -
                                 b[0][1] * (b[0][1] * b[2][2] - b[1][2] * b[0][2]) +
                                 b[0][2] * (b[0][1] * b[1][2] - b[1][1] * b[0][2]);
      EXPECT_GE(b[0][0], -1e-6 * trace);
      EXPECT_GE(minor, -1e-5 * trace * trace);
      EXPECT_GE(determinant, -1e-5 * trace * trace * trace);
    }
  }
}

TEST_P(Energies, InternalForcesHaveNoNetForceAndNoNetTorque) {
  const auto organ = block_organ(GetParam());
  Probe probe(organ);
  const auto u = testing::random_vectors(organ.mesh.node_count(), 0.003f, 5);
  Vec3d force, torque;
  double size = 0;
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n) {
    const Vec3d g = probe.at(NodeIndex(n), u).gradient;
    const Vec3d rest = organ.mesh.rest_positions[n];
    force += g;
    // Linear elasticity knows no turned body: its torques balance about the rest positions.
    torque += cross(GetParam().is_linear ? rest : rest + to_double(u[n]), g);
    size += length(g);
  }
  EXPECT_LT(length(force), 1e-6 * size);
  EXPECT_LT(length(torque), 1e-6 * size * 0.03);
}

TEST_P(Energies, RigidMotionCostsNothing) {
  const auto organ = block_organ(GetParam());
  Probe probe(organ);
  const std::vector<Vec3f> rest(organ.mesh.node_count());
  const double at_rest = probe.energy(rest);
  const double strained = probe.energy(testing::random_vectors(rest.size(), 0.001f, 3)) - at_rest;
  ASSERT_GT(strained, 0);
  const double angle = GetParam().is_linear ? 1e-4 : 1.1;
  const Vec3d axis = normalized(Vec3d{1, 2, -0.5}, Vec3d{});
  std::vector<Vec3f> turned;
  for (const auto& p : organ.mesh.rest_positions) {
    const Vec3d q = p * std::cos(angle) + cross(axis, p) * std::sin(angle) +
                    axis * (dot(axis, p) * (1 - std::cos(angle)));
    turned.push_back(to_float(q - p + Vec3d{0.02, -0.01, 0.03}));
  }
  EXPECT_NEAR(probe.energy(turned), at_rest, 1e-6 * std::max(strained, std::abs(at_rest)));
  // And a deformed body that is turned has the energy it had.
  if (GetParam().is_linear) return;
  const auto u = testing::random_vectors(rest.size(), 0.002f, 4);
  std::vector<Vec3f> both;
  for (std::size_t n = 0; n < u.size(); ++n) {
    const Vec3d p = organ.mesh.rest_positions[n] + to_double(u[n]);
    const Vec3d q = p * std::cos(angle) + cross(axis, p) * std::sin(angle) +
                    axis * (dot(axis, p) * (1 - std::cos(angle)));
    both.push_back(to_float(q - organ.mesh.rest_positions[n]));
  }
  EXPECT_NEAR(probe.energy(both) / probe.energy(u), 1, 1e-5);
}

TEST_P(Energies, RestIsFreeOfForceUnlessTensed) {
  const auto organ = block_organ(GetParam());
  Probe probe(organ);
  const std::vector<Vec3f> rest(organ.mesh.node_count());
  double largest = 0;
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
    largest = std::max(largest, length(probe.at(NodeIndex(n), rest).gradient));
  if (GetParam().has_stress_at_rest)
    EXPECT_GT(largest, 1e-3);
  else
    EXPECT_LT(largest, 2e-6) << "N";
}

class IsotropicEnergies : public Energies {};

TEST_P(IsotropicEnergies, SmallStrainStoresTheEnergyOfLinearElasticity) {
  const auto organ = block_organ(GetParam());
  Probe probe(organ);
  // Uniform compression: W = 9/2 K e^2, with K = 2/3 E for springs.
  const double e = 1e-4;
  std::vector<Vec3f> u;
  for (const auto& p : organ.mesh.rest_positions) u.push_back(to_float(p * e));
  const auto lame = material::lame_parameters(organ.material);
  const double bulk = organ.material.elastic_law == ElasticLaw::Springs
                          ? 2.0 / 3 * organ.material.young_modulus_pa
                          : lame.lambda_pa + 2.0 / 3 * lame.mu_pa;
  const std::vector<Vec3f> rest(u.size());
  const double density = (probe.energy(u) - probe.energy(rest)) / mesh::total_volume(organ.mesh);
  EXPECT_NEAR(density / (4.5 * bulk * e * e), 1, 2e-3);
  if (organ.material.elastic_law == ElasticLaw::Springs) return;
  // Simple shear: W = 1/2 mu g^2.
  for (std::size_t n = 0; n < u.size(); ++n)
    u[n] = Vec3f{static_cast<float>(organ.mesh.rest_positions[n].y * e), 0, 0};
  EXPECT_NEAR((probe.energy(u) - probe.energy(rest)) / mesh::total_volume(organ.mesh) /
                  (0.5 * lame.mu_pa * e * e),
              1, 2e-3);
}

std::string name_of(const ::testing::TestParamInfo<Case>& tested) {
  return tested.param.name;
}

const auto kIsotropic = ::testing::Values(
    Case{.name = "Springs", .change = [](organ::Organ&) {}},
    Case{.name = "TensorMass",
         .change = [](organ::Organ& o) { o.material.elastic_law = ElasticLaw::TensorMass; },
         .is_linear = true},
    Case{.name = "NeoHookean",
         .change = [](organ::Organ& o) { o.material.elastic_law = ElasticLaw::NeoHookean; }},
    Case{.name = "NeoHookeanAveragedStrain", .change = [](organ::Organ& o) {
           o.material.elastic_law = ElasticLaw::NeoHookean;
           o.material.has_averaged_strain = true;
         }});

void put_under_tension(organ::Organ& organ) {
  organ.material.tension = 0.04;
  organ.material.fibre_direction = {1, 0, 1};
  organ.material.fibre_tension = 0.02;
}

// A direction at most nodes, turning from one to the next, of either sign; another one elsewhere.
void give_directions(organ::Organ& organ) {
  organ.material.fibre_direction = {0, 0, 1};
  organ.material.fibre_tension = 0.05;
  for (std::size_t n = 0; n < organ.mesh.node_count(); ++n) {
    const auto& p = organ.mesh.rest_positions[n];
    const Vec3d axis = normalized(Vec3d{1, 30 * p.x, 20 * p.z - 40 * p.y}, {});
    organ.fibre_directions.push_back(n % 7 == 0 ? Vec3d{} : n % 2 == 0 ? axis : -axis);
  }
}

// A measured law is not with the isotropic ones: its C20 resists growth beside the bulk modulus.
const auto kOthers =
    ::testing::Values(
        Case{.name = "Measured",
             .change =
                 [](organ::Organ& o) {
                   material::use_measured(*material::find_measured_material("human_liver_nava2008"),
                                          o.material);
                 }},
        Case{.name = "MeasuredExponential",
             .change =
                 [](organ::Organ& o) {
                   auto material = *material::find_measured_material("human_liver_nava2008");
                   material.energy = material::StrainEnergy::Exponential;
                   material.exponent = 3;
                   material::use_measured(material, o.material);
                 }},
        Case{.name = "MeasuredAveragedStrain",
             .change =
                 [](organ::Organ& o) {
                   material::use_measured(*material::find_measured_material("human_liver_nava2008"),
                                          o.material);
                   o.material.has_averaged_strain = true;
                 }},
        Case{.name = "AveragedStrainUnderTension",
             .change =
                 [](organ::Organ& o) {
                   o.material.elastic_law = ElasticLaw::NeoHookean;
                   o.material.has_averaged_strain = true;
                   put_under_tension(o);
                 },
             .has_stress_at_rest = true},
        Case{.name = "SpringsAlongFibres",
             .change =
                 [](organ::Organ& o) {
                   o.material.fibre_direction = {0, 2, 0};
                   o.material.fibre_stiffness_ratio = 0.1;
                 }},
        Case{.name = "SpringsUnderTension",
             .change = [](organ::Organ& o) { put_under_tension(o); },
             .has_stress_at_rest = true},
        Case{.name = "TensorMassUnderTension",
             .change =
                 [](organ::Organ& o) {
                   o.material.elastic_law = ElasticLaw::TensorMass;
                   put_under_tension(o);
                 },
             .is_linear = true,
             .has_stress_at_rest = true},
        Case{.name = "NeoHookeanUnderTension",
             .change =
                 [](organ::Organ& o) {
                   o.material.elastic_law = ElasticLaw::NeoHookean;
                   put_under_tension(o);
                 },
             .has_stress_at_rest = true},
        Case{.name = "SpringsAlongDirections",
             .change =
                 [](organ::Organ& o) {
                   o.material.fibre_stiffness_ratio = 3;
                   give_directions(o);
                 },
             .has_stress_at_rest = true},
        Case{.name = "TensorMassAlongDirections",
             .change =
                 [](organ::Organ& o) {
                   o.material.elastic_law = ElasticLaw::TensorMass;
                   give_directions(o);
                 },
             .is_linear = true,
             .has_stress_at_rest = true},
        Case{.name = "NeoHookeanAlongDirections",
             .change =
                 [](organ::Organ& o) {
                   o.material.elastic_law = ElasticLaw::NeoHookean;
                   give_directions(o);
                 },
             .has_stress_at_rest = true},
        Case{.name = "NeoHookeanStiffInclusion", .change = [](organ::Organ& o) {
               o.material.elastic_law = ElasticLaw::NeoHookean;
               auto stiff = o.material;
               stiff.young_modulus_pa *= 10;
               std::vector<NodeIndex> nodes;
               for (std::uint32_t n = 0; n < o.mesh.node_count() / 2; ++n) nodes.emplace_back(n);
               o.regions = {{"half", stiff, nodes}};
             }});

INSTANTIATE_TEST_SUITE_P(Isotropic, Energies, kIsotropic, name_of);
INSTANTIATE_TEST_SUITE_P(Others, Energies, kOthers, name_of);
INSTANTIATE_TEST_SUITE_P(All, IsotropicEnergies, kIsotropic, name_of);

// The same direction everywhere, of whatever sign, is the material's own to the bit.
TEST(FibreDirections, OfOneDirectionAreTheMaterials) {
  const Vec3d axis = normalized(Vec3d{0.3, -0.7, 0.45}, {});
  for (const auto law : {ElasticLaw::Springs, ElasticLaw::TensorMass, ElasticLaw::NeoHookean}) {
    auto change = [](organ::Organ& o) {
      o.material.fibre_tension = 0.05;
      o.material.tension = 0.02;
      o.material.fibre_stiffness_ratio = 3;
    };
    auto own = block_organ({.name = "own", .change = change});
    own.material.elastic_law = law;
    auto field = own;
    own.material.fibre_direction = axis;
    field.material.fibre_direction = {1, 0, 0};
    for (std::size_t n = 0; n < field.mesh.node_count(); ++n)
      field.fibre_directions.push_back(n % 3 == 0 ? -axis : axis);
    ASSERT_TRUE(organ::validate(field));
    std::vector<Vec3f> u;
    for (std::size_t n = 0; n < own.mesh.node_count(); ++n)
      u.push_back(Vec3f{float(n * 7 % 11), float(n * 5 % 13), float(n * 3 % 7)} * 3e-4f);
    Probe a(own), b(field);
    EXPECT_EQ(a.energy(u), b.energy(u)) << static_cast<int>(law);
    for (std::uint32_t n = 0; n < u.size(); ++n) {
      const auto at_a = a.at(NodeIndex(n), u), at_b = b.at(NodeIndex(n), u);
      ASSERT_EQ(at_a.gradient, at_b.gradient) << static_cast<int>(law) << " node " << n;
      ASSERT_EQ(at_a.block, at_b.block) << static_cast<int>(law) << " node " << n;
    }
  }
}

// --- Laws of Psi ---

// These are the coefficients of Dogan 2011, table 1, divided by C10.
constexpr ReducedPolynomialLaw kLiverLaw{
    {1.7079f / 0.8838f, 1.4499f / 0.8838f, 2.6918f / 0.8838f, 1.7575f / 0.8838f}};

constexpr ExponentialLaw kFungLaw{2.5f};

template <typename Law>
void expect_derivatives_of_energy(const Law& law) {
  for (const double e : {0.01, 0.3, 1.0}) {
    Float8 first, second;
    law.derivatives(all(static_cast<float>(e)), first, second);
    Lanes f, s;
    store(f, first);
    store(s, second);
    const double h = 1e-4;
    const double slope = (law.energy(e + h) - law.energy(e - h)) / (2 * h);
    const double curvature = (law.energy(e + h) - 2 * law.energy(e) + law.energy(e - h)) / (h * h);
    EXPECT_NEAR(static_cast<double>(f.v[0]) / slope, 1, 1e-5);
    EXPECT_NEAR(static_cast<double>(s.v[0]) / curvature, 1, 1e-3);
  }
  Float8 first, second;
  law.derivatives(all(-0.5f), first, second);
  Lanes f, s;
  store(f, first);
  store(s, second);
  EXPECT_EQ(f.v[0], 1.0f) << "continued linearly below I1 = 3";
  EXPECT_EQ(s.v[0], 0.0f);
}

TEST(ReducedPolynomial, DerivativesAreThoseOfTheEnergy) {
  expect_derivatives_of_energy(kLiverLaw);
}

TEST(Exponential, DerivativesAreThoseOfTheEnergy) {
  expect_derivatives_of_energy(kFungLaw);
  const double e = 0.7, b = static_cast<double>(kFungLaw.exponent);
  EXPECT_NEAR(kFungLaw.energy(e), std::expm1(b * e) / b, 1e-12);
}

TEST(Exponential, IsExpToSinglePrecisionAndFiniteHoweverFarTissueIsStretched) {
  for (float x = 0; x <= 80; x += 0.0137f) {
    Lanes values;
    store(values, exp8(all(x)));
    ASSERT_NEAR(static_cast<double>(values.v[3]) / std::exp(static_cast<double>(x)), 1, 3e-7) << x;
  }
  Float8 first, second;
  kFungLaw.derivatives(all(1e30f), first, second);
  Lanes f, s;
  store(f, first);
  store(s, second);
  EXPECT_TRUE(std::isfinite(f.v[0]));
  EXPECT_EQ(s.v[0], 0.0f);
}

template <typename Law>
void expect_gradient_and_block(const Law& law) {
  const auto organ = block_organ({.name = "", .change = [](organ::Organ& o) {
                                    o.material.elastic_law = ElasticLaw::NeoHookean;
                                  }});
  const topology::Topology topology(organ);
  const Groups groups(topology, Coupling::Elements);
  const Hyperelastic<Law> energy(topology, groups, nullptr,
                                 hyperelastic_parameters(organ, material::is_hyperelastic), law);
  const auto energy_j = [&](std::span<const Vec3d> displacements) {
    std::vector<double> shares(groups.slot_count());
    energy.add_energies_j(displacements, shares);
    return std::accumulate(shares.begin(), shares.end(), 0.0);
  };
  std::vector<Float4> x(groups.slot_count());
  std::vector<Vec3d> u(groups.slot_count());
  // In this pose no tet is near I1 = 3, where the law's second derivative jumps.
  const auto random = testing::random_vectors(organ.mesh.node_count(), 0.0015f, 1);
  for (std::uint32_t n = 0; n < random.size(); ++n) {
    x[groups.slot_of(NodeIndex(n))] = to_float4(random[n]);
    u[groups.slot_of(NodeIndex(n))] = to_double(random[n]);
  }
  const auto gradient_at = [&](Slot slot) {
    NodeStep8 step{zero_vec8(), zero_sym_mat8()};
    energy.add(slot / kLanes, x.data(), load_group(&x[slot / kLanes * kLanes]), step);
    Vec3Lanes g;
    SymMat3Lanes b;
    store(g, step.gradient);
    store(b, step.block);
    return std::pair(to_double(g.at(slot % kLanes)), b.at(slot % kLanes));
  };
  for (std::uint32_t n = 0; n < random.size(); n += 4) {
    const Slot slot = groups.slot_of(NodeIndex(n));
    const auto [g, block] = gradient_at(slot);
    const double h = 1e-6;
    const double kept = u[slot].x;
    u[slot].x = kept + h;
    const double plus = energy_j(u);
    u[slot].x = kept - h;
    const double minus = energy_j(u);
    u[slot].x = kept;
    EXPECT_NEAR((plus - minus) / (2 * h), g.x, 2e-4 * (length(g) + 1e-2));
    const float kept_x = x[slot].x;
    x[slot].x = kept_x + 5e-5f;
    const Vec3d up = gradient_at(slot).first;
    const double high = x[slot].x;
    x[slot].x = kept_x - 5e-5f;
    const Vec3d down = gradient_at(slot).first;
    const double low = x[slot].x;
    x[slot].x = kept_x;
    const double scale = static_cast<double>(block.xx + block.yy + block.zz);
    EXPECT_NEAR((up.x - down.x) / (high - low), static_cast<double>(block.xx), 3e-3 * scale);
    EXPECT_NEAR((up.y - down.y) / (high - low), static_cast<double>(block.xy), 3e-3 * scale);
  }

  // The derivatives over one other node: moved, it changes the gradient by them.
  class Column final : public StiffnessSink {
   public:
    Column(Slot s, Slot o) : slot(s), other(o) {}
    void add(const SlotLanes& others, const Mat8& stiffness) override {
      const auto lane = slot % kLanes;
      if (others.v[lane] != other) return;
      Lanes x_part, y_part, z_part;
      store(x_part, stiffness.x.x);
      store(y_part, stiffness.y.x);
      store(z_part, stiffness.z.x);
      sum += to_double(Vec3f{x_part.v[lane], y_part.v[lane], z_part.v[lane]});
    }
    const Slot slot, other;
    Vec3d sum;
  };
  for (std::uint32_t n = 0; n < random.size(); ++n) {  // away from the kink at I1 = 3
    auto& v = x[groups.slot_of(NodeIndex(n))];
    v = to_float4(to_vec3(v) * 0.3f + to_float(organ.mesh.rest_positions[n] * 0.2));
  }
  for (std::uint32_t n = 1; n < random.size(); n += 5) {
    const Slot slot = groups.slot_of(NodeIndex(n));
    const Slot other =
        groups.slot_of(topology.tet(topology.tets_of(NodeIndex(n)).front())[n % 2 ? 3 : 0]);
    if (other == slot) continue;
    Column column(slot, other);
    NodeStep8 step{zero_vec8(), zero_sym_mat8()};
    energy.linearise(slot / kLanes, x.data(), load_group(&x[slot / kLanes * kLanes]), step, column);
    const float kept = x[other].x;
    x[other].x = kept + 5e-5f;
    const Vec3d up = gradient_at(slot).first;
    const double high = x[other].x;
    x[other].x = kept - 5e-5f;
    const Vec3d down = gradient_at(slot).first;
    const double low = x[other].x;
    x[other].x = kept;
    const Vec3d slope = (up - down) / (high - low);
    EXPECT_GT(length(slope), 0.1);
    EXPECT_LT(length(slope - column.sum), 3e-3 * length(slope)) << n;
  }
}

TEST(ReducedPolynomial, TetsHaveItsGradientAndBlock) {
  expect_gradient_and_block(kLiverLaw);
}
TEST(Exponential, TetsHaveItsGradientAndBlock) {
  expect_gradient_and_block(kFungLaw);
}

}  // namespace
}  // namespace trocar::dynamics
