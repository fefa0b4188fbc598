#include "server/organs/organ/organ.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numeric>

#include "tests/mesh/block_mesh.h"

namespace trocar::organ {
namespace {

Organ block_organ(int n = 4) {
  Organ organ;
  organ.name = "block";
  organ.source = "test";
  organ.mesh = trocar::testing::block_mesh(n, 0.01);
  organ.node_masses_kg = lumped_masses(organ);
  organ.fixed_nodes = {NodeIndex(0), NodeIndex(3)};
  return organ;
}

// Energy of the springs per volume under the small affine strain that stretches along `axis` by
// `strain` and nothing across.
double spring_energy_density(const Organ& organ, const Vec3d& axis, double strain) {
  const auto springs = springs_of(organ);
  const auto& pairs = organ.mesh.spring_pairs();
  double energy = 0;
  for (std::size_t e = 0; e < pairs.size(); ++e) {
    const Vec3d edge =
        organ.mesh.rest_positions[pairs[e][1].value] - organ.mesh.rest_positions[pairs[e][0].value];
    const Vec3d stretched = edge + axis * (strain * dot(edge, axis));
    const double elongation = length(stretched) - length(edge);
    energy += 0.5 * springs[e].stiffness_n_m * elongation * elongation;
  }
  return energy / mesh::total_volume(organ.mesh);
}

TEST(SpringStiffness, AffineStretchStoresTheEnergyOfTheSolid) {
  const Organ organ = block_organ();
  const double strain = 1e-5, modulus = organ.material.young_modulus_pa;
  // Uniaxial strain, Poisson 1/4: W = 1/2 (lambda + 2 mu) e^2 with lambda = mu = 2/5 E. The six
  // axes of an icosahedron average a quartic over the sphere exactly.
  const double g = (1 + std::sqrt(5.0)) / 2, r = 1 / std::sqrt(1 + g * g);
  const Vec3d axes[6] = {{0, r, g * r},  {0, r, -g * r}, {r, g * r, 0},
                         {r, -g * r, 0}, {g * r, 0, r},  {-g * r, 0, r}};
  double mean = 0;
  for (const Vec3d& axis : axes) mean += spring_energy_density(organ, axis, strain) / 6;
  EXPECT_NEAR(mean / (0.5 * 1.2 * modulus * strain * strain), 1.0, 1e-4);
}

TEST(SpringStiffness, UniformDilationIsExactOnAnyMesh) {
  Organ organ = block_organ(3);
  for (std::size_t i = 0; i < organ.mesh.node_count(); ++i) {  // no regular directions left
    Vec3d& p = organ.mesh.rest_positions[i];
    p += Vec3d{double(i * 7 % 11) - 5, double(i * 5 % 13) - 6, double(i * 3 % 7) - 3} * 2e-4;
  }
  ASSERT_TRUE(mesh::validate(organ.mesh)) << mesh::validate(organ.mesh).error().message;
  const auto springs = springs_of(organ);
  double energy = 0;
  const double strain = 0.01;
  for (std::size_t e = 0; e < springs.size(); ++e) {
    const double l = length(organ.mesh.rest_positions[organ.mesh.edges[e][1].value] -
                            organ.mesh.rest_positions[organ.mesh.edges[e][0].value]);
    energy += 0.5 * springs[e].stiffness_n_m * strain * strain * l * l;
  }
  // W = 9/2 K e^2 with K = 2/3 E.
  EXPECT_NEAR(energy / mesh::total_volume(organ.mesh) / (3 * 4000 * strain * strain), 1.0, 1e-12);
}

TEST(SpringStiffness, ConstantLawGivesOneNumber) {
  Organ organ = block_organ();
  organ.material.spring_law = material::SpringLaw::Constant;
  organ.material.spring_stiffness_n_m = 12.5;
  const auto springs = springs_of(organ);
  ASSERT_EQ(springs.size(), organ.mesh.edges.size());
  for (const auto& spring : springs) EXPECT_EQ(spring.stiffness_n_m, 12.5);
}

TEST(Organ, MassesSumToDensityTimesVolume) {
  const Organ organ = block_organ();
  EXPECT_NEAR(std::accumulate(organ.node_masses_kg.begin(), organ.node_masses_kg.end(), 0.0),
              1060 * 0.04 * 0.04 * 0.04, 1e-12);
}

TEST(Organ, HashFollowsEveryArrayAndNoName) {
  const Organ organ = block_organ();
  const auto hash = organ_hash(organ);
  const auto changed = [&](const std::function<void(Organ&)>& change) {
    Organ other = organ;
    change(other);
    return organ_hash(other) != hash;
  };
  EXPECT_TRUE(changed([](Organ& o) { o.mesh.rest_positions[3].y += 1e-12; }));
  EXPECT_TRUE(changed([](Organ& o) { std::swap(o.mesh.tets[0], o.mesh.tets[1]); }));
  EXPECT_TRUE(changed([](Organ& o) { o.mesh.links.push_back({NodeIndex(0), NodeIndex(1)}); }));
  EXPECT_TRUE(changed([](Organ& o) { o.mesh.boundary_triangles.pop_back(); }));
  EXPECT_TRUE(changed([](Organ& o) { o.fixed_nodes.pop_back(); }));
  EXPECT_TRUE(changed([](Organ& o) { o.node_masses_kg[0] *= 2; }));
  EXPECT_TRUE(changed([](Organ& o) { o.material.young_modulus_pa += 1; }));
  EXPECT_TRUE(changed([](Organ& o) { o.material.spring_law = material::SpringLaw::Constant; }));
  EXPECT_FALSE(changed([](Organ& o) { o.name = "other"; }));
}

TEST(Organ, ValidateNamesWhatIsWrong) {
  ASSERT_TRUE(validate(block_organ())) << validate(block_organ()).error().message;
  const auto message = [](const std::function<void(Organ&)>& change) {
    Organ organ = block_organ();
    change(organ);
    const Status status = validate(organ);
    return status.ok() ? std::string("accepted") : status.error().message;
  };
  const auto expect = [&](const char* part, const std::function<void(Organ&)>& change) {
    EXPECT_NE(message(change).find(part), std::string::npos) << message(change);
  };
  expect("node masses for", [](Organ& o) { o.node_masses_kg.pop_back(); });
  expect("mass of node 2", [](Organ& o) { o.node_masses_kg[2] = NAN; });
  expect("mass of node 2", [](Organ& o) { o.node_masses_kg[2] = 0; });
  expect("fixed node 125", [](Organ& o) { o.fixed_nodes.push_back(NodeIndex(125)); });
  expect("ascending order", [](Organ& o) { o.fixed_nodes.push_back(NodeIndex(3)); });
  expect("density", [](Organ& o) { o.material.density_kg_m3 = -1; });
  expect("Young", [](Organ& o) { o.material.young_modulus_pa = NAN; });
  expect("spring law",
         [](Organ& o) { o.material.spring_law = static_cast<material::SpringLaw>(7); });
  expect("volume-consistent", [](Organ& o) {
    o.mesh.links = {{NodeIndex(0), NodeIndex(1)}};
    o.mesh.build_adjacency();
  });
  expect("larger than 2 m", [](Organ& o) {
    for (auto& p : o.mesh.rest_positions) p *= 100;
  });
  expect("not centred", [](Organ& o) {
    for (auto& p : o.mesh.rest_positions) p.x += 0.001;
  });
  expect("source offset", [](Organ& o) { o.source_offset_m.z = INFINITY; });
  expect("name", [](Organ& o) { o.name.clear(); });
  expect("tets 0 and", [](Organ& o) {
    o.mesh.tets.push_back(o.mesh.tets[0]);
    o.mesh.build_adjacency();
  });
}

}  // namespace
}  // namespace trocar::organ
