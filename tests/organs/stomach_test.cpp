#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <vector>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/catalogue/stomach_shape.h"
#include "server/organs/mesh/pieces.h"

namespace trocar::organ {
namespace {

const Organ& stomach() {
  static const Organ organ = *catalogue::load_organ("stomach");
  return organ;
}

// In the coordinates of stomach_shape.h.
Vec3d place(const Organ& organ, NodeIndex node) {
  return organ.mesh.rest_positions[node.value] + organ.source_offset_m;
}

struct Faces {
  std::vector<NodeIndex> outer, inner, ends;
};

Faces faces_of(const Organ& organ) {
  Faces faces;
  for (const NodeIndex node : organ.mesh.surface_nodes) {
    const double depth = catalogue::stomach_sac_field(place(organ, node));
    (std::abs(depth) < 1e-6                               ? faces.outer
     : std::abs(depth + catalogue::kStomachWall_m) < 1e-6 ? faces.inner
                                                          : faces.ends)
        .push_back(node);
  }
  return faces;
}

// Number of edges from each node to the nearest of `from`.
std::vector<int> steps_from(const mesh::TetMesh& mesh, const std::vector<NodeIndex>& from) {
  std::vector<int> steps(mesh.node_count(), -1);
  std::vector<NodeIndex> queue = from;
  for (const NodeIndex node : from) steps[node.value] = 0;
  for (std::size_t i = 0; i < queue.size(); ++i)
    for (const NodeIndex next : mesh.node_neighbours[queue[i]])
      if (steps[next.value] < 0) {
        steps[next.value] = steps[queue[i].value] + 1;
        queue.push_back(next);
      }
  return steps;
}

// Whether the triangles at every surface node form one closed fan, and all of them one surface.
bool is_one_surface(const mesh::TetMesh& mesh) {
  std::vector<std::map<NodeIndex, NodeIndex>> fans(mesh.node_count());
  for (const auto& [a, b, c] : mesh.boundary_triangles) {
    fans[a.value][b] = c;
    fans[b.value][c] = a;
    fans[c.value][a] = b;
  }
  std::vector<NodeIndex> queue{mesh.surface_nodes.front()};
  std::vector<bool> reached(mesh.node_count());
  reached[queue.front().value] = true;
  for (std::size_t i = 0; i < queue.size(); ++i) {
    const auto& fan = fans[queue[i].value];
    std::size_t around = 0;
    NodeIndex at = fan.begin()->first;
    do {
      if (!reached[at.value]) queue.push_back(at);
      reached[at.value] = true;
      at = fan.at(at);
      ++around;
    } while (at != fan.begin()->first && around <= fan.size());
    if (around != fan.size()) return false;
  }
  return queue.size() == mesh.surface_nodes.size();
}

TEST(Stomach, DefaultHasTheStatedFigures) {
  const Organ& organ = stomach();
  const auto& mesh = organ.mesh;
  EXPECT_NEAR(static_cast<double>(mesh.tets.size()), catalogue::kDefaultStomachTets,
              0.05 * catalogue::kDefaultStomachTets);
  Vec3d high{};
  for (const Vec3d& p : mesh.rest_positions)
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  EXPECT_NEAR(high.x * 2, 0.198, 0.002);
  EXPECT_NEAR(high.y * 2, 0.220, 0.002);
  EXPECT_NEAR(high.z * 2, 0.125, 0.002);
  EXPECT_NEAR(mesh::total_volume(mesh), 0.4625e-3, 0.002e-3);
  const double mass =
      std::accumulate(organ.node_masses_kg.begin(), organ.node_masses_kg.end(), 0.0);
  EXPECT_NEAR(mass, 1060 * mesh::total_volume(mesh), 1e-9);
  const auto angles = mesh::dihedral_range(mesh);
  EXPECT_GT(angles.min_deg, 14);
  EXPECT_LT(angles.max_deg, 150);
}

TEST(Stomach, MeshIsTheSameOnEveryMachine) {
  EXPECT_EQ(organ_hash(stomach()), 0xf8cfe36f17f8c4d8ull) << std::hex << organ_hash(stomach());
}

// Every way through the wall crosses two tets or more, if no edge leads from face to face.
void expect_wall_of_two_tets(const Organ& organ) {
  const Faces faces = faces_of(organ);
  EXPECT_GT(faces.outer.size(), 5000u);
  EXPECT_GT(faces.inner.size(), 3900u);
  EXPECT_LT(faces.ends.size(), faces.outer.size() / 20);
  const auto steps = steps_from(organ.mesh, faces.outer);
  for (const NodeIndex node : faces.inner) ASSERT_GE(steps[node.value], 2);
}

TEST(Stomach, IsOneTubeWithAWallOfTwoTetsAtEverySize) {
  for (const int target :
       {catalogue::kMinStomachTets, catalogue::kDefaultStomachTets, 72'000, 110'000}) {
    SCOPED_TRACE(target);
    const auto organ = catalogue::make_stomach(target);  // validates
    ASSERT_TRUE(organ.ok()) << organ.error().message;
    const auto& mesh = organ->mesh;
    EXPECT_NEAR(static_cast<double>(mesh.tets.size()), target, 0.05 * target);
    EXPECT_EQ(mesh::find_pieces(mesh).count, 1u);
    // Euler characteristic V - E + F with E = 3/2 F: 0 for one surface of genus 1.
    EXPECT_EQ(2 * mesh.surface_nodes.size(), mesh.boundary_triangles.size());
    EXPECT_TRUE(is_one_surface(mesh));
    expect_wall_of_two_tets(*organ);
    const auto angles = mesh::dihedral_range(mesh);
    EXPECT_GT(angles.min_deg, mesh::kStuffingMinDihedral_deg);
    EXPECT_LT(angles.max_deg, mesh::kStuffingMaxDihedral_deg);
  }
  EXPECT_FALSE(catalogue::make_stomach(catalogue::kMinStomachTets - 1).ok());
  EXPECT_FALSE(catalogue::make_stomach(catalogue::kMaxStomachTets + 1).ok());
}

TEST(Stomach, WallIsAsThickAsStated) {
  const Organ& organ = stomach();
  const Faces faces = faces_of(organ);
  // From the inner face, away from the ends, to the nearest node of the outer one. Between nodes
  // the surface is up to half an edge nearer; in the notches the wall is thicker.
  std::vector<double> thicknesses;
  for (std::size_t i = 0; i < faces.inner.size(); i += 7) {
    const Vec3d p = place(organ, faces.inner[i]);
    if (catalogue::is_stomach_held(p)) continue;
    double least = 1;
    for (const NodeIndex node : faces.outer)
      least = std::min(least, length(place(organ, node) - p));
    thicknesses.push_back(least);
  }
  std::sort(thicknesses.begin(), thicknesses.end());
  EXPECT_GT(thicknesses.front(), 0.0066);
  EXPECT_LT(thicknesses[thicknesses.size() / 2], 0.0078);
  EXPECT_LT(thicknesses[thicknesses.size() * 95 / 100], 0.0090);
}

TEST(Stomach, HasTheLandmarksOfAStomach) {
  const auto hollow = [](double x, double y, double z) {
    return catalogue::stomach_sac_field({x, y, z}) < -catalogue::kStomachWall_m;
  };
  const auto outside = [](double x, double y, double z) {
    return catalogue::stomach_sac_field({x, y, z}) > 0;
  };
  EXPECT_TRUE(hollow(0.050, 0.085, -0.034));    // fundus
  EXPECT_TRUE(hollow(0.050, 0.000, 0.000));     // body
  EXPECT_TRUE(hollow(-0.040, -0.062, 0.014));   // antrum
  EXPECT_TRUE(hollow(-0.010, 0.105, -0.036));   // oesophagus
  EXPECT_TRUE(hollow(-0.080, -0.023, -0.004));  // pylorus
  // The fundus rises beside the oesophagus, with a notch between them.
  EXPECT_TRUE(outside(0.010, 0.105, -0.035));
  // The lesser curvature is hollow: between pylorus and cardia lies nothing of the stomach.
  EXPECT_TRUE(outside(-0.030, 0.010, 0.000));
  EXPECT_TRUE(outside(-0.012, -0.030, 0.010));
  // The body is wider than the antrum, and that wider than the pylorus.
  const auto width = [&](const Vec3d& middle, const Vec3d& across) {
    double w = 0;
    for (const double side : {-1.0, 1.0})
      for (double s = 0; catalogue::stomach_sac_field(middle + across * (side * s)) < 0;
           s += 0.0005)
        w += 0.0005;
    return w;
  };
  const double body = width({0.053, 0.028, -0.014}, {0, 0, 1});
  const double antrum = width({-0.047, -0.058, 0.011}, {0, 0, 1});
  const double pylorus = width({-0.080, -0.023, -0.004}, {0, 0, 1});
  EXPECT_NEAR(body, 0.095, 0.006);
  EXPECT_NEAR(antrum, 0.050, 0.005);
  EXPECT_LT(pylorus, 0.040);
}

TEST(Stomach, IsOpenAtBothEndsAndHeldThere) {
  // Through either opening a straight way leads out of the hollow.
  for (const auto& [within, beyond] :
       {std::pair{Vec3d{-0.007, 0.096, -0.035}, Vec3d{-0.018, 0.129, -0.038}},
        std::pair{Vec3d{-0.080, -0.023, -0.004}, Vec3d{-0.104, 0.000, -0.016}}})
    for (double t = 0; t <= 1; t += 0.01)
      EXPECT_GT(catalogue::stomach_field(within + (beyond - within) * t), 0) << t;
  const Organ& organ = stomach();
  std::size_t at_cardia = 0, at_pylorus = 0;
  for (const NodeIndex node : organ.fixed_nodes) {
    const Vec3d p = place(organ, node);
    const double up = std::abs(catalogue::beyond_cardia(p)),
                 down = std::abs(catalogue::beyond_pylorus(p));
    EXPECT_LT(std::min(up, down), 0.0085);
    (p.y > 0.05 ? at_cardia : at_pylorus) += 1;
  }
  EXPECT_GT(at_cardia, 80u);
  EXPECT_GT(at_pylorus, 80u);
  EXPECT_LT(static_cast<double>(organ.fixed_nodes.size()),
            0.03 * static_cast<double>(organ.mesh.node_count()));
}

}  // namespace
}  // namespace trocar::organ
