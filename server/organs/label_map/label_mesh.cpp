#include "server/organs/label_map/label_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

#include "server/organs/mesh/fill_field.h"

namespace trocar::label_map {
namespace {

constexpr int kSamples = 5;  // along an edge of a tet, 35 in all

// The label of most of a tet's volume, by points spread evenly in it; the lower of equal ones.
std::uint16_t label_of(const LabelSolid& solid, const mesh::TetMesh& mesh, const mesh::Tet& tet) {
  std::map<std::uint16_t, int> counts;
  for (int a = 0; a < kSamples; ++a)
    for (int b = 0; a + b < kSamples; ++b)
      for (int c = 0; a + b + c < kSamples; ++c) {
        const int d = kSamples - 1 - a - b - c;
        const double weights[4] = {a + 0.25, b + 0.25, c + 0.25, d + 0.25};
        Vec3d p;
        for (std::size_t i = 0; i < 4; ++i)
          p += mesh.rest_positions[tet[i].value] * (weights[i] / kSamples);
        if (const auto label = solid.label_at(p); label != 0) ++counts[label];
      }
  if (counts.empty()) return 0;
  return std::ranges::max_element(counts, {}, &std::pair<const std::uint16_t, int>::second)->first;
}

// Regions, the largest first: where tets could belong to several by their nodes, the smallest, such
// as a tumour, goes before. Tets beside the solid belong to none.
void add_regions(const LabelSolid& solid,
                 const std::vector<std::pair<std::uint16_t, std::string>>& names, LabelMesh& out) {
  const auto& mesh = out.imported.mesh;
  std::map<std::uint16_t, std::vector<NodeIndex>> nodes;
  std::map<std::uint16_t, double> volumes;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    const auto label = label_of(solid, mesh, mesh.tets[t]);
    volumes[label] += tet_volume(mesh, TetIndex(t));
    nodes[label].insert(nodes[label].end(), mesh.tets[t].begin(), mesh.tets[t].end());
  }
  auto labels = solid.labels();
  std::ranges::stable_sort(labels, std::ranges::greater{},
                           [&](std::uint16_t label) { return solid.volume_of(label); });
  for (const auto label : labels) {
    const auto named =
        std::ranges::find(names, label, &std::pair<std::uint16_t, std::string>::first);
    mesh::NamedNodes region{named == names.end() ? "label " + std::to_string(label) : named->second,
                            std::move(nodes[label])};
    out.notes.push_back(fmt::format("{}: {:.4g} ml, the map's {:.4g} ml", region.name,
                                    1e6 * volumes[label], 1e6 * solid.volume_of(label)));
    std::sort(region.nodes.begin(), region.nodes.end());
    region.nodes.erase(std::unique(region.nodes.begin(), region.nodes.end()), region.nodes.end());
    if (region.nodes.empty())
      out.imported.warnings.push_back(region.name + " is too small for the mesh, and left out");
    else
      out.imported.regions.push_back(std::move(region));
  }
}

}  // namespace

Result<LabelMesh> mesh_labels(const LabelSolid& solid, int nodes,
                              const std::vector<std::pair<std::uint16_t, std::string>>& names,
                              const std::string& name) {
  auto filled = mesh::fill_field([&](const Vec3d& p) { return solid.distance(p); }, solid.box(),
                                 solid.volume_m3(), solid.surface_m2() / 1.5, nodes);
  if (!filled) return Error{ErrorCode::BadFile, name + ": " + filled.error().message};
  LabelMesh out;
  out.imported.mesh = std::move(filled->mesh);
  out.imported.warnings = solid.warnings();
  const auto& map = solid.map();
  const double mm = 1e3;
  out.notes.push_back(fmt::format(
      "labels in {} order, voxels of {:.3g} x {:.3g} x {:.3g} mm; here x is the patient's left, y "
      "the head, z the front",
      map.orientation, mm * length(map.steps_m[0]), mm * length(map.steps_m[1]),
      mm * length(map.steps_m[2])));
  const double volume = total_volume(out.imported.mesh);
  const auto angles = dihedral_range(out.imported.mesh);
  out.notes.push_back(fmt::format("filled with {} nodes and {} tets, spacing {:.2f} mm",
                                  out.imported.mesh.node_count(), out.imported.mesh.tets.size(),
                                  mm * filled->spacing_m));
  out.notes.push_back(
      fmt::format("volume {:.4g} ml, {:+.2f} % of the map's {:.4g} ml; dihedral angles {:.1f} to "
                  "{:.1f} degrees",
                  1e6 * volume, 100 * (volume / solid.volume_m3() - 1), 1e6 * solid.volume_m3(),
                  angles.min_deg, angles.max_deg));
  if (solid.labels().size() > 1) add_regions(solid, names, out);
  out.imported.offset_m = centre_on_origin(out.imported.mesh);
  return out;
}

}  // namespace trocar::label_map
