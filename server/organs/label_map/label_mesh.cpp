#include "server/organs/label_map/label_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "server/organs/label_map/label_field.h"
#include "server/organs/label_map/label_fit.h"
#include "server/organs/label_map/thin_labels.h"
#include "server/organs/mesh/conform.h"
#include "server/organs/mesh/fill_field.h"
#include "server/organs/mesh/match_volumes.h"

namespace trocar::label_map {
namespace {

constexpr double kGoodCount = 0.05, kAcceptableCount = 0.15;  // shares of the asked number
constexpr int kAttempts = 6;
constexpr double kFewer = 0.93;      // share of the lattice's nodes where a number gives no mesh
constexpr double kKeptInMesh = 0.8;  // share of a label's voxels below which the report warns

using Names = std::vector<std::pair<std::uint16_t, std::string>>;

struct Filled {
  mesh::TetMesh mesh;
  double spacing_m = 0;
  // Two labels or more:
  std::vector<std::uint16_t> tet_labels;
  std::size_t steps = 0;
};

std::string name_of(std::uint16_t label, const Names& names) {
  const auto named = std::ranges::find(names, label, &std::pair<std::uint16_t, std::string>::first);
  return named == names.end() ? "label " + std::to_string(label) : named->second;
}

// The largest first: a node of several belongs to the smallest, such as a tumour.
std::vector<std::uint16_t> largest_first(const LabelSolid& solid) {
  auto labels = solid.labels();
  std::ranges::stable_sort(labels, std::ranges::greater{},
                           [&](std::uint16_t label) { return solid.volume_of(label); });
  return labels;
}

// The tets of a label and their nodes.
mesh::NamedNodes region_of(const Filled& filled, std::uint16_t label, const std::string& name) {
  mesh::NamedNodes region{name, {}, {}};
  for (std::size_t t = 0; t < filled.mesh.tets.size(); ++t)
    if (filled.tet_labels[t] == label) {
      region.tets.emplace_back(t);
      region.nodes.insert(region.nodes.end(), filled.mesh.tets[t].begin(),
                          filled.mesh.tets[t].end());
    }
  std::ranges::sort(region.nodes);
  region.nodes.erase(std::unique(region.nodes.begin(), region.nodes.end()), region.nodes.end());
  return region;
}

Result<Filled> fill(const LabelSolid& solid, int nodes) {
  auto filled = mesh::fill_field([&](const Vec3d& p) { return solid.distance(p); }, solid.box(),
                                 solid.volume_m3(), solid.surface_m2() / kVoxelsOverSurface, nodes);
  if (!filled) return filled.error();
  return Filled{std::move(filled->mesh), filled->spacing_m, {}, 0};
}

// The interfaces take nodes, too: the lattice gets as many fewer.
Result<Filled> fill_with_interfaces(const LabelSolid& solid, int nodes) {
  const LabelField field(solid);
  std::optional<Filled> best;
  double best_error = std::numeric_limits<double>::infinity();
  std::optional<Error> failure;
  int lattice_nodes = nodes;
  const auto try_fewer = [&](const Error& error) {
    failure = failure.value_or(error);
    lattice_nodes = std::max(static_cast<int>(kFewer * lattice_nodes), mesh::kMinFillNodes);
  };
  for (int i = 0; i < kAttempts; ++i) {
    auto filled =
        mesh::fill_field([&](const Vec3d& p) { return solid.distance(p); }, solid.box(),
                         solid.volume_m3(), solid.surface_m2() / kVoxelsOverSurface, lattice_nodes);
    if (!filled) {
      try_fewer(filled.error());
      continue;
    }
    const double grown = filled->grown_m;
    auto conforming = mesh::conform_to_labels(
        filled->mesh, filled->spacing_m, [&](const Vec3d& p) { return field(p); },
        [&](const Vec3d& p) { return solid.distance(p) - grown; });
    if (!conforming) {
      try_fewer({ErrorCode::BadFile,
                 conforming.error().message + ": ask for another number of nodes (--nodes)"});
      continue;
    }
    const double volume = total_volume(conforming->mesh);
    if (std::abs(volume / solid.volume_m3() - 1) > mesh::kFillVolumeTolerance) {
      try_fewer({ErrorCode::BadFile,
                 "its interfaces change the volume by more than 1 %: ask for another number of "
                 "nodes (--nodes)"});
      continue;
    }
    const double ratio = static_cast<double>(conforming->mesh.node_count()) / nodes;
    if (std::abs(ratio - 1) < best_error) {
      best_error = std::abs(ratio - 1);
      best = Filled{std::move(conforming->mesh), filled->spacing_m,
                    std::move(conforming->tet_labels), conforming->steps};
    }
    if (best_error < kGoodCount) break;
    // Half steps end a swing between two lattices.
    const double step = i < kAttempts / 2 ? ratio : std::sqrt(ratio);
    const int next = std::clamp(static_cast<int>(std::lround(lattice_nodes / step)),
                                mesh::kMinFillNodes, mesh::kMaxFillNodes);
    if (next == lattice_nodes) break;
    lattice_nodes = next;
  }
  if (!best) return *failure;
  if (best_error > kAcceptableCount)
    return Error{ErrorCode::BadFile,
                 fmt::format("cannot be filled with about {} nodes, the nearest number is {}: ask "
                             "for another number (--nodes)",
                             nodes, best->mesh.node_count())};
  return std::move(*best);
}

// A tube comes out whole where it is 1.2 spacings across.
constexpr double kNeededSpacings = 1.4;
std::string advice(const LabelFit& fit, const LabelSolid& solid) {
  const double spacing = fit.thickness_m / kNeededSpacings;
  const double needed = 1.3 * 2 * solid.volume_m3() / (spacing * spacing * spacing);
  return needed > mesh::kMaxFillNodes
             ? fmt::format("no number of nodes up to {} is enough", mesh::kMaxFillNodes)
             : fmt::format("ask for more nodes, such as --nodes {:.0f}",
                           1000 * std::ceil(needed / 1000));
}

void warn_of_losses(const LabelFit& fit, const std::string& name, const LabelSolid& solid,
                    std::vector<std::string>& warnings) {
  const bool is_in_pieces = fit.mesh_pieces > fit.map_pieces;
  if (!is_in_pieces && fit.kept >= kKeptInMesh &&
      std::abs(fit.mesh_m3 / fit.map_m3 - 1) < kMissedVolume)
    return;
  std::string text = fmt::format("{}: {:.0f} % of its voxels lie in it, {:.3g} ml beside it", name,
                                 std::floor(100 * fit.kept), 1e6 * (1 - fit.kept) * fit.map_m3);
  if (is_in_pieces)
    text += fmt::format(", it is in {} pieces, the map's in {}", fit.mesh_pieces, fit.map_pieces);
  warnings.push_back(text + ": it is too thin for the mesh; " + advice(fit, solid));
}

void add_regions(const LabelSolid& solid, const Names& names, Filled& filled, LabelMesh& out) {
  const auto labels = largest_first(solid);
  std::vector<std::pair<std::uint16_t, double>> volumes;
  for (std::size_t l = labels.size(); l-- > 1;)
    volumes.emplace_back(labels[l], solid.volume_of(labels[l]));
  const auto match = [&] {
    mesh::match_volumes(filled.mesh, filled.tet_labels, volumes,
                        kMaxInterfaceShift * filled.spacing_m, mesh::conforming_bound());
  };
  const auto places = filled.mesh.rest_positions;
  match();
  std::vector<std::uint16_t> smallest_first(labels.rbegin(), labels.rend() - 1);
  if (fill_thin_labels(solid, filled.mesh, smallest_first, filled.tet_labels)) {
    filled.mesh.rest_positions = places;
    match();
  }
  const auto fits = fit_of_labels(solid, filled.mesh, filled.tet_labels);
  for (std::size_t l = 0; l < labels.size(); ++l) {
    const auto name = name_of(labels[l], names);
    const auto& fit = *std::ranges::find(fits, labels[l], &LabelFit::label);
    out.notes.push_back(fmt::format("{}: {:.4g} ml, {:+.2f} % of the map's {:.4g} ml", name,
                                    1e6 * fit.mesh_m3, 100 * (fit.mesh_m3 / fit.map_m3 - 1),
                                    1e6 * fit.map_m3));
    auto region = region_of(filled, labels[l], name);
    if (region.tets.empty()) {
      out.imported.left_out.push_back(
          fmt::format("left out {}, {:.3g} ml: it is too small for the mesh; {}", name,
                      1e6 * fit.map_m3, advice(fit, solid)));
      continue;
    }
    // The largest gets what the others lose, and theirs is the warning.
    if (l > 0 || fit.mesh_pieces > fit.map_pieces)
      warn_of_losses(fit, name, solid, out.imported.warnings);
    out.imported.regions.push_back(std::move(region));
  }
  out.notes.push_back(
      fmt::format("interfaces follow faces of tets; through {} tets of {} one passes", filled.steps,
                  filled.mesh.tets.size()));
}

}  // namespace

Result<LabelMesh> mesh_labels(const LabelSolid& solid, int nodes, const Names& names,
                              const std::string& name) {
  const bool has_interfaces = solid.labels().size() > 1;
  auto filled = has_interfaces ? fill_with_interfaces(solid, nodes) : fill(solid, nodes);
  if (!filled) return Error{ErrorCode::BadFile, name + ": " + filled.error().message};
  LabelMesh out;
  out.imported.warnings = solid.warnings();
  std::vector<std::string> of_labels;
  if (has_interfaces) {
    add_regions(solid, names, *filled, out);
    of_labels = std::exchange(out.notes, {});
  }
  auto& mesh = out.imported.mesh = std::move(filled->mesh);
  const auto& map = solid.map();
  const double mm = 1e3;
  out.notes.push_back(fmt::format(
      "labels in {} order, voxels of {:.3g} x {:.3g} x {:.3g} mm; here x is the patient's left, y "
      "the head, z the front",
      map.orientation, mm * length(map.steps_m[0]), mm * length(map.steps_m[1]),
      mm * length(map.steps_m[2])));
  const double volume = total_volume(mesh);
  const auto angles = dihedral_range(mesh);
  out.notes.push_back(fmt::format("filled with {} nodes and {} tets, spacing {:.2f} mm",
                                  mesh.node_count(), mesh.tets.size(), mm * filled->spacing_m));
  out.notes.push_back(
      fmt::format("volume {:.4g} ml, {:+.2f} % of the map's {:.4g} ml; dihedral angles {:.1f} to "
                  "{:.1f} degrees",
                  1e6 * volume, 100 * (volume / solid.volume_m3() - 1), 1e6 * solid.volume_m3(),
                  angles.min_deg, angles.max_deg));
  std::ranges::move(of_labels, std::back_inserter(out.notes));
  out.imported.offset_m = centre_on_origin(mesh);
  return out;
}

}  // namespace trocar::label_map
