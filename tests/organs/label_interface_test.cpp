// Faces of tets follow the interfaces between labels: a liver with a vessel that enters it and a
// lump, as an imported organ has them.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <numbers>
#include <set>

#include "server/organs/catalogue/import_organ.h"
#include "server/organs/label_map/label_mesh.h"
#include "server/organs/label_map/thin_labels.h"
#include "server/organs/mesh/stuffing.h"

namespace trocar::catalogue {
namespace {

using label_map::LabelMap;

constexpr double kVoxel_m = 0.0015;
constexpr std::array<int, 3> kSize{90, 70, 64};
const std::array<Vec3d, 3> kSteps{Vec3d{kVoxel_m, 0, 0}, Vec3d{0, kVoxel_m, 0},
                                  Vec3d{0, 0, kVoxel_m}};
constexpr std::uint16_t kLiver = 1, kVessel = 2, kLump = 3;
constexpr double kLumpRadius_m = 0.014;
constexpr double kBend_m = 0.05;  // radius of the vessel's centre line
const Vec3d kLumpCentre{-0.02, 0.018, 0.01};

// Below 0 inside, m; places from the centre of the liver.
double in_liver(const Vec3d& p) {
  return length(Vec3d{p.x / 0.06, p.y / 0.045, p.z / 0.04}) - 1;
}
double to_vessel(const Vec3d& p, double radius_m) {
  return std::hypot(std::hypot(p.x, p.y + kBend_m) - kBend_m, p.z) - radius_m;
}
double to_lump(const Vec3d& p) {
  return length(p - kLumpCentre) - kLumpRadius_m;
}

// steps: of a voxel along i, j and k, m. The middle of the map is at the origin.
LabelMap map_of(std::array<int, 3> size, const std::array<Vec3d, 3>& steps,
                const std::function<int(const Vec3d&)>& label) {
  LabelMap map;
  map.size = size;
  map.labels.resize(std::size_t(size[0]) * std::size_t(size[1]) * std::size_t(size[2]));
  Vec3d origin;
  for (std::size_t d = 0; d < 3; ++d) origin -= steps[d] * ((size[d] - 1) / 2.0);
  EXPECT_TRUE(set_place(origin, steps, map).ok());
  for (int k = 0; k < size[2]; ++k)
    for (int j = 0; j < size[1]; ++j)
      for (int i = 0; i < size[0]; ++i)
        map.labels[map.index(i, j, k)] = static_cast<std::uint16_t>(
            label(origin + steps[0] * double(i) + steps[1] * double(j) + steps[2] * double(k)));
  map.names = {{kLiver, "liver"}, {kVessel, "vessel"}, {kLump, "lump"}};
  return map;
}

LabelMap liver_map(double vessel_radius_m, std::array<int, 3> size = kSize,
                   const std::array<Vec3d, 3>& steps = kSteps) {
  return map_of(size, steps, [&](const Vec3d& p) {
    if (in_liver(p) > 0) return 0;
    if (to_vessel(p, vessel_radius_m) < 0) return int{kVessel};
    return to_lump(p) < 0 ? int{kLump} : int{kLiver};
  });
}

ImportedOrgan imported(LabelMap map, int nodes) {
  ImportOptions options;
  options.nodes = nodes;
  auto result = import_labels(std::move(map), "liver.nii", options);
  EXPECT_TRUE(result.ok()) << (result.ok() ? "" : result.error().message);
  return std::move(*result);
}

struct Figures {
  std::map<std::string, double> volumes_m3;   // of each region
  double greatest_cells = 0, mean_cells = 0;  // of nodes of the interfaces from the true ones
  std::size_t interface_nodes = 0;
  mesh::DihedralRange angles;
  double spacing_m = 0;
};

// Measures the organ as a session has it.
// away: distance of a place from the nearest interface.
Figures figures_of(const ImportedOrgan& result, const std::function<double(const Vec3d&)>& away) {
  const auto& organ = result.organ;
  const auto& mesh = organ.mesh;
  const auto material = organ::material_map(organ);
  Figures out;
  for (const auto& note : result.notes)
    if (const auto at = note.find("spacing "); at != std::string::npos)
      out.spacing_m = 1e-3 * std::stod(note.substr(at + 8));
  std::map<std::array<NodeIndex, 3>, std::uint16_t> faces;
  std::set<NodeIndex> nodes;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    EXPECT_GT(tet_volume(mesh, TetIndex(t)), 0);
    if (material.tets[t] > 0)
      out.volumes_m3[organ.regions[material.tets[t] - 1u].name] += tet_volume(mesh, TetIndex(t));
    for (std::size_t without = 0; without < 4; ++without) {
      std::array<NodeIndex, 3> face{mesh.tets[t][(without + 1) % 4],
                                    mesh.tets[t][(without + 2) % 4],
                                    mesh.tets[t][(without + 3) % 4]};
      std::sort(face.begin(), face.end());
      const auto [known, is_first] = faces.try_emplace(face, material.tets[t]);
      if (!is_first && known->second != material.tets[t]) nodes.insert(face.begin(), face.end());
    }
  }
  for (const NodeIndex node : nodes) {
    const double cells =
        std::abs(away(mesh.rest_positions[node.value] + organ.source_offset_m)) / out.spacing_m;
    out.greatest_cells = std::max(out.greatest_cells, cells);
    out.mean_cells += cells / static_cast<double>(nodes.size());
  }
  out.interface_nodes = nodes.size();
  out.angles = mesh::dihedral_range(mesh);
  return out;
}

void print(const ImportedOrgan& result, const Figures& figures) {
  std::printf(
      "%zu nodes, %zu tets, spacing %.2f mm; %zu nodes of interfaces, %.3f cells away, at "
      "most %.3f; angles %.1f to %.1f degrees\n",
      result.organ.mesh.node_count(), result.organ.mesh.tets.size(), 1e3 * figures.spacing_m,
      figures.interface_nodes, figures.mean_cells, figures.greatest_cells, figures.angles.min_deg,
      figures.angles.max_deg);
  for (const auto& note : result.notes) std::printf("  %s\n", note.c_str());
  for (const auto& warning : result.warnings) std::printf("  warning: %s\n", warning.c_str());
}

// The request: each label's volume within 1 %, angles as good as those of the outer surface. Nodes
// of an interface are where it is but for a voxel, and for what the volume took.
void expect_fit(const ImportedOrgan& result, const Figures& figures, const LabelMap& map) {
  EXPECT_TRUE(validate(result.organ)) << validate(result.organ).error().message;
  EXPECT_GE(figures.angles.min_deg, mesh::kStuffingMinDihedral_deg);
  EXPECT_LE(figures.angles.max_deg, mesh::kStuffingMaxDihedral_deg);
  std::map<std::string, double> map_m3;
  for (const auto label : map.labels)
    if (label != 0) map_m3[map.names[label - 1u].second] += map.voxel_volume_m3();
  double whole = 0;
  for (const auto& [name, volume] : map_m3) {
    ASSERT_TRUE(figures.volumes_m3.contains(name)) << name;
    EXPECT_NEAR(figures.volumes_m3.at(name), volume, 0.01 * volume) << name;
    whole += volume;
  }
  EXPECT_NEAR(total_volume(result.organ.mesh), whole, 0.01 * whole);
  const double voxel =
      std::max({length(map.steps_m[0]), length(map.steps_m[1]), length(map.steps_m[2])});
  EXPECT_LE(figures.greatest_cells * figures.spacing_m,
            voxel + label_map::kMaxInterfaceShift * figures.spacing_m);
}

double to_interfaces(const Vec3d& p) {
  return std::min(std::abs(to_vessel(p, 0.008)), std::abs(to_lump(p)));
}

TEST(LabelInterface, IsFollowedByFacesOfTets) {
  const auto map = liver_map(0.008);
  for (const int nodes : {2000, 4000, 12000}) {
    const auto start = std::chrono::steady_clock::now();
    const auto result = imported(map, nodes);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    const auto figures = figures_of(result, to_interfaces);
    std::printf("%d nodes asked, %.2f s: ", nodes, took.count());
    print(result, figures);
    expect_fit(result, figures, map);
    EXPECT_NEAR(static_cast<double>(result.organ.mesh.node_count()), nodes, 0.15 * nodes);
    EXPECT_TRUE(result.warnings.empty());
  }
}

TEST(LabelInterface, SameMapGivesTheSameOrgan) {
  const auto map = liver_map(0.008);
  EXPECT_EQ(organ_hash(imported(map, 2000).organ), organ_hash(imported(map, 2000).organ));
}

// Slices are thicker than pixels are wide, and stand at an angle.
TEST(LabelInterface, IsFollowedInSlices) {
  const double s = std::sin(0.5), c = std::cos(0.5), wide = 0.001, thick = 0.003;
  const auto map = liver_map(0.008, {140, 96, 48},
                             {Vec3d{c, 0, s} * wide, Vec3d{0, wide, 0}, Vec3d{-s, 0, c} * thick});
  const auto result = imported(map, 4000);
  const auto figures = figures_of(result, to_interfaces);
  print(result, figures);
  expect_fit(result, figures, map);
}

TEST(LabelInterface, ALumpTouchesAVessel) {
  const Vec3d centre{0, 0.01, 0};
  const auto map = map_of(kSize, kSteps, [&](const Vec3d& p) {
    if (in_liver(p) > 0) return 0;
    if (to_vessel(p, 0.008) < 0) return int{kVessel};
    return length(p - centre) < 0.016 ? int{kLump} : int{kLiver};
  });
  const auto result = imported(map, 4000);
  const auto figures = figures_of(result, [&](const Vec3d& p) {
    return std::min(std::abs(to_vessel(p, 0.008)), std::abs(length(p - centre) - 0.016));
  });
  print(result, figures);
  expect_fit(result, figures, map);
}

TEST(LabelInterface, AVesselFourThirdsCellsThickIsWhole) {
  const auto map = liver_map(0.0045);
  const auto result = imported(map, 4000);
  const auto figures = figures_of(result, [](const Vec3d& p) {
    return std::min(std::abs(to_vessel(p, 0.0045)), std::abs(to_lump(p)));
  });
  print(result, figures);
  expect_fit(result, figures, map);
  EXPECT_TRUE(result.warnings.empty());
}

// A vessel of 3 mm in cells of 18 mm is at its place in parts only, and so is one of 6 mm in cells
// of 7 mm: the report says it, and with the nodes that it asks for all is there.
TEST(LabelInterface, WhatIsTooThinIsSaid) {
  const auto thin = imported(liver_map(0.0015), 300);
  ASSERT_FALSE(thin.warnings.empty());
  EXPECT_EQ(thin.warnings.back().find("vessel: "), 0u) << thin.warnings.back();
  EXPECT_NE(thin.warnings.back().find(" ml beside it, it is in "), std::string::npos)
      << thin.warnings.back();
  const auto map = liver_map(0.003);
  const auto away = [](const Vec3d& p) {
    return std::min(std::abs(to_vessel(p, 0.003)), std::abs(to_lump(p)));
  };
  const auto partly = imported(map, 4000);
  print(partly, figures_of(partly, away));
  ASSERT_EQ(partly.warnings.size(), 1u);
  const auto& warning = partly.warnings[0];
  EXPECT_NE(warning.find("vessel: "), std::string::npos) << warning;
  EXPECT_NE(warning.find("pieces, the map's in 1"), std::string::npos) << warning;
  const auto advice = warning.find("such as --nodes ");
  ASSERT_NE(advice, std::string::npos) << warning;
  const auto whole = imported(map, std::stoi(warning.substr(advice + 16)));
  const auto figures = figures_of(whole, away);
  print(whole, figures);
  expect_fit(whole, figures, map);
  EXPECT_TRUE(whole.warnings.empty());
}

// A vessel of 2 x 2 voxels that runs through the liver, in cells of 1.5 to 5 times its thickness.
// Each region keeps its volume within 5 %, from which on interfaces are not enough; and tets of the
// vessel lie all along it: so few as there are, none is more than three cells from the next.
TEST(LabelInterface, AVesselOfTwoVoxelsKeepsItsVolume) {
  for (const bool is_upright : {false, true}) {
    const auto map = map_of(kSize, kSteps, [&](const Vec3d& p) {
      if (in_liver(p) > 0) return 0;
      const double across = is_upright ? p.x : p.z;
      return std::abs(across) < kVoxel_m && std::abs(p.y) < kVoxel_m ? int{kVessel} : int{kLiver};
    });
    double vessel = 0, whole = 0;
    for (const auto label : map.labels) {
      vessel += label == kVessel ? map.voxel_volume_m3() : 0;
      whole += label != 0 ? map.voxel_volume_m3() : 0;
    }
    for (const int nodes : {300, 1000, 2000, 4000}) {
      SCOPED_TRACE(fmt::format("{} nodes, {}", nodes, is_upright ? "upright" : "level"));
      const auto result = imported(map, nodes);
      ASSERT_TRUE(validate(result.organ)) << validate(result.organ).error().message;
      auto figures = figures_of(result, to_interfaces);
      print(result, figures);
      const auto& mesh = result.organ.mesh;
      EXPECT_NEAR(figures.volumes_m3["vessel"], vessel, label_map::kMissedVolume * vessel);
      EXPECT_NEAR(figures.volumes_m3["liver"], whole - vessel, 0.01 * whole);
      EXPECT_NEAR(figures.volumes_m3["vessel"] + figures.volumes_m3["liver"], total_volume(mesh),
                  1e-9 * whole);
      const auto region =
          std::ranges::find(result.organ.regions, "vessel", &material::MaterialRegion::name);
      ASSERT_NE(region, result.organ.regions.end());
      const auto tets = organ::material_map(result.organ).tets;
      const auto index = static_cast<std::uint16_t>(region - result.organ.regions.begin() + 1);
      const double end = is_upright ? 0.04 : 0.06;
      std::vector<double> along{-end, end};  // the vessel, m: its ends and the middle of each tet
      for (std::size_t t = 0; t < tets.size(); ++t) {
        if (tets[t] != index) continue;
        Vec3d middle;
        for (const NodeIndex node : mesh.tets[t]) middle += mesh.rest_positions[node.value] / 4;
        along.push_back(is_upright ? middle.z : middle.x);
      }
      std::ranges::sort(along);
      double gap = 0;
      for (std::size_t i = 1; i < along.size(); ++i) gap = std::max(gap, along[i] - along[i - 1]);
      EXPECT_LE(gap, 3 * figures.spacing_m);
      EXPECT_GE(figures.angles.min_deg, mesh::kStuffingMinDihedral_deg);
      EXPECT_LE(figures.angles.max_deg, mesh::kStuffingMaxDihedral_deg);
    }
  }
}

TEST(LabelInterface, WhatIsSmallerThanHalfATetIsLeftOutWithItsVolume) {
  const auto map = map_of(kSize, kSteps, [](const Vec3d& p) {
    if (in_liver(p) > 0) return 0;
    return p.x > 0 && p.x < kVoxel_m && p.y > 0 && p.y < kVoxel_m && p.z > 0 && p.z < kVoxel_m
               ? int{kLump}
               : int{kLiver};
  });
  const auto result = imported(map, 300);
  ASSERT_FALSE(result.warnings.empty());
  EXPECT_EQ(result.warnings.back(),
            "left out lump, 0.00337 ml: it is too small for the mesh; no number of nodes up to "
            "100000 is enough");
  ASSERT_EQ(result.organ.regions.size(), 1u);
  EXPECT_EQ(result.organ.regions[0].name, "liver");
}

}  // namespace
}  // namespace trocar::catalogue
