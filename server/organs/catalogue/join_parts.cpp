#include "server/organs/catalogue/join_parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include "server/organs/catalogue/five_tets.h"
#include "server/organs/catalogue/lay_ties.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/material/material_file.h"
#include "server/organs/mesh/fill_field.h"
#include "server/organs/mesh/pieces.h"

namespace trocar::catalogue {
namespace {

Error wrong(const PartFile& file, const PartRule& part, const std::string& what) {
  return {ErrorCode::BadFile, file.source.string() + ": part \"" + part.name + "\": " + what};
}

mesh::TetMesh box_mesh(const Vec3d& size_m, const std::array<int, 3>& cells) {
  mesh::TetMesh mesh;
  const auto [nx, ny, nz] = cells;
  for (int k = 0; k <= nz; ++k)
    for (int j = 0; j <= ny; ++j)
      for (int i = 0; i <= nx; ++i)
        mesh.rest_positions.push_back({size_m.x * (static_cast<double>(i) / nx - 0.5),
                                       size_m.y * (static_cast<double>(j) / ny - 0.5),
                                       size_m.z * (static_cast<double>(k) / nz - 0.5)});
  const auto at = [nx = nx, ny = ny](int i, int j, int k) {
    return NodeIndex(i + (nx + 1) * (j + (ny + 1) * k));
  };
  for (int k = 0; k < nz; ++k)
    for (int j = 0; j < ny; ++j)
      for (int i = 0; i < nx; ++i) add_five_tets(mesh, i, j, k, at);
  return mesh;
}

Result<mesh::TetMesh> ellipsoid_mesh(const Vec3d& size_m, int nodes) {
  const Vec3d r = size_m * 0.5;
  // It is exact to first order at the surface, which is where it is asked for.
  const auto distance = [r](const Vec3d& p) {
    const Vec3d scaled{p.x / r.x, p.y / r.y, p.z / r.z};
    const Vec3d slope{scaled.x / r.x, scaled.y / r.y, scaled.z / r.z};
    const double k = length(scaled), steep = length(slope);
    return steep > 0 ? k * (k - 1) / steep : -std::min({r.x, r.y, r.z});
  };
  constexpr double kPi = std::numbers::pi;
  auto filled = mesh::fill_field(distance, {-r, r}, 4.0 / 3 * kPi * r.x * r.y * r.z,
                                 4.0 / 3 * kPi * (r.x * r.y + r.y * r.z + r.z * r.x), nodes);
  if (!filled) return filled.error();
  return std::move(filled->mesh);
}

// The body alone, whose derived lists are still to come.
Result<organ::Organ> shape_of(const PartRule& part) {
  organ::Organ organ;
  if (part.source == "box") {
    organ.mesh = box_mesh(*part.size_m, *part.cells);
  } else {
    auto mesh = ellipsoid_mesh(*part.size_m, part.import.nodes.value_or(kDefaultFillNodes));
    if (!mesh) return mesh.error();
    organ.mesh = std::move(*mesh);
  }
  organ.mesh.build_adjacency();
  organ.material.elastic_law = material::ElasticLaw::NeoHookean;
  return organ;
}

Result<organ::Organ> source_of(const PartFile& file, const PartRule& part, JoinedParts& joined) {
  if (part.size_m) return shape_of(part);
  const std::filesystem::path given(part.source);
  const auto path =
      given.has_extension() && !given.is_absolute() ? file.source.parent_path() / given : given;
  if (path.extension() == ".toml")
    return Error{ErrorCode::BadFile, path.string() +
                                         ": is a part file or a scenario: name a mesh, "
                                         "a surface, a scan or an .organ file"};
  if (!can_be_imported(path)) return load_organ(path.string());
  auto imported = import_organ(path, part.import);
  if (!imported) return imported.error();
  for (const auto& note : imported->notes) joined.notes.push_back(part.name + ": " + note);
  for (const auto& warning : imported->warnings)
    if (!warning.ends_with("separate pieces; all are kept"))  // here one is
      joined.warnings.push_back(part.name + ": " + warning);
  return std::move(imported->organ);
}

Status change_material(const PartFile& file, const PartMaterial& change, material::Material& m) {
  if (change.measured) {
    const bool is_file = change.measured->ends_with(".toml");
    const auto measured = material::measured_material(
        is_file ? (file.source.parent_path() / *change.measured).string() : *change.measured);
    if (!measured) return measured.error();
    material::use_measured(*measured, m);
  }
  m.elastic_law = change.elastic_law.value_or(m.elastic_law);
  for (std::size_t i = 0; i < change.numbers.size(); ++i) {
    const auto& key = material::kNumberKeys[i];
    if (!change.numbers[i]) continue;
    if (const auto why = material::why_not_with(key.key, m.elastic_law); !why.empty())
      return Error{ErrorCode::BadFile, std::string(key.key) + ": " + std::string(why)};
    m.*key.member = *change.numbers[i];
  }
  if (change.elastic_law == material::ElasticLaw::Springs)
    m.spring_law = material::SpringLaw::VolumeConsistent;
  if (!change.has_averaged_strain) return {};
  if (const auto why = material::why_not_with("averaged_strain", m.elastic_law); !why.empty())
    return Error{ErrorCode::BadFile, "averaged_strain: " + std::string(why)};
  m.has_averaged_strain = *change.has_averaged_strain;
  return {};
}

// Returns which tets stay: those of the largest body.
std::vector<std::uint8_t> largest_body(const mesh::TetMesh& mesh, std::uint32_t& dropped) {
  const auto pieces = mesh::find_pieces(mesh);
  std::vector<double> volumes(pieces.count);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    volumes[pieces.piece_of_tet[t]] += mesh::tet_volume(mesh, TetIndex(t));
  const auto largest =
      static_cast<std::uint32_t>(std::ranges::max_element(volumes) - volumes.begin());
  dropped = pieces.count - 1;
  std::vector<std::uint8_t> stays;
  for (const auto piece : pieces.piece_of_tet) stays.push_back(piece == largest ? 1 : 0);
  return stays;
}

// New numbers of nodes and tets; invalid ones are left out.
struct Renumbered {
  std::vector<NodeIndex> nodes;
  std::vector<TetIndex> tets;

  template <typename Number>
  static std::vector<Number> kept(const std::vector<Number>& old, const std::vector<Number>& map) {
    std::vector<Number> numbers;
    for (const auto number : old)
      if (map[number.value].is_valid()) numbers.push_back(map[number.value]);
    return numbers;
  }
};

Renumbered add_mesh(const organ::Organ& from, const Vec3d& by_m, organ::Organ& to,
                    std::uint32_t& dropped) {
  Renumbered map{std::vector<NodeIndex>(from.mesh.node_count()),
                 std::vector<TetIndex>(from.mesh.tets.size())};
  const auto stays = largest_body(from.mesh, dropped);
  for (std::size_t t = 0; t < stays.size(); ++t)
    if (stays[t] != 0)
      for (const auto node : from.mesh.tets[t]) map.nodes[node.value] = NodeIndex(0);
  auto& mesh = to.mesh;
  for (std::size_t n = 0; n < map.nodes.size(); ++n) {
    if (!map.nodes[n].is_valid()) continue;
    map.nodes[n] = NodeIndex(mesh.node_count());
    mesh.rest_positions.push_back(from.mesh.rest_positions[n] + from.source_offset_m + by_m);
    to.fibre_directions.push_back(from.fibre_directions.empty() ? Vec3d{}
                                                                : from.fibre_directions[n]);
  }
  for (std::size_t t = 0; t < stays.size(); ++t) {
    if (stays[t] == 0) continue;
    map.tets[t] = TetIndex(mesh.tets.size());
    auto& tet = mesh.tets.emplace_back();
    for (std::size_t k = 0; k < 4; ++k) tet[k] = map.nodes[from.mesh.tets[t][k].value];
  }
  return map;
}

std::vector<NodeIndex> held_nodes(const PartRule& part, const organ::Organ& source) {
  if (part.is_held_whole) {
    std::vector<NodeIndex> all;
    for (std::size_t n = 0; n < source.mesh.node_count(); ++n) all.emplace_back(n);
    return all;
  }
  const bool is_import = !part.size_m && can_be_imported(part.source);
  if (is_import || (!part.has_hold && !part.size_m)) return source.fixed_nodes;
  return nodes_held_by(part.import.fix, source.mesh);
}

// The part's own region, then those of its source.
Status add_regions(const PartFile& file, const PartRule& part, const organ::Organ& source,
                   const Renumbered& map, organ::Organ& organ) {
  const auto is_left = [](const auto number) { return number.is_valid(); };
  material::MaterialRegion whole{part.name, source.material, {}, {}, part.look};
  for (const auto node : map.nodes)
    if (is_left(node)) whole.nodes.push_back(node);
  std::vector<material::MaterialRegion> regions{std::move(whole)};
  for (const auto& region : source.regions) {
    material::MaterialRegion own{part.name + "/" + region.name, region.material,
                                 Renumbered::kept(region.nodes, map.nodes),
                                 Renumbered::kept(region.tets, map.tets), region.look};
    if (!own.nodes.empty() && (region.tets.empty() || !own.tets.empty()))
      regions.push_back(std::move(own));
  }
  for (auto& region : regions) {
    if (auto s = change_material(file, part.material, region.material); !s)
      return wrong(file, part, s.error().message);
    organ.regions.push_back(std::move(region));
  }
  return {};
}

Status add_part(const PartFile& file, const PartRule& part, JoinedParts& joined) {
  const auto source = source_of(file, part, joined);
  if (!source) return wrong(file, part, source.error().message);
  if (source->mesh.tets.empty() || !source->mesh.links.empty())
    return wrong(file, part, "is of links, a part must be of tetrahedra alone");
  if (!source->stress_free_positions_m.empty())
    return wrong(file, part,
                 "rests under gravity or tension (settle), take the organ as it was before");
  if (!source->fine_surface.empty())
    joined.warnings.push_back(part.name + ": its fine surface is left out");
  std::uint32_t dropped = 0;
  auto& organ = joined.organ;
  const auto map = add_mesh(*source, part.at_m, organ, dropped);
  if (dropped > 0)
    joined.warnings.push_back(fmt::format("{}: its largest body is kept, {} of {} are left out",
                                          part.name, dropped, dropped + 1));
  const auto held = Renumbered::kept(held_nodes(part, *source), map.nodes);
  organ.fixed_nodes.insert(organ.fixed_nodes.end(), held.begin(), held.end());
  return add_regions(file, part, *source, map, organ);
}

Status add_ties(const PartFile& file, const TieRule& rule, JoinedParts& joined) {
  auto& organ = joined.organ;
  const auto nodes_of = [&](const std::string& name) -> const std::vector<NodeIndex>& {
    return std::ranges::find(organ.regions, name, &material::MaterialRegion::name)->nodes;
  };
  auto ties = lay_ties(organ.mesh, nodes_of(rule.between[0]), nodes_of(rule.between[1]),
                       rule.within_m, rule.area_m2);
  const auto says = [&](const std::string& what) {
    return fmt::format("{}: ties \"{}\": {}", file.source.string(), rule.name, what);
  };
  if (ties.empty())
    return Error{ErrorCode::BadFile,
                 says(fmt::format("no place of {} is within {:.3g} mm of {} and faces it: raise "
                                  "within_mm, or check at_mm",
                                  rule.between[0], 1e3 * rule.within_m, rule.between[1]))};
  if (ties.size() > organ::kMaxTies)
    return Error{ErrorCode::BadFile, says(fmt::format("would be {} ties, allowed are {}: raise "
                                                      "each_mm2",
                                                      ties.size(), organ::kMaxTies))};
  double area_m2 = 0;
  for (const auto& tie : ties) area_m2 += tie.area_m2;
  joined.notes.push_back(fmt::format("ties {}: {} over {:.4g} cm2, {:.4g} mJ to part them",
                                     rule.name, ties.size(), 1e4 * area_m2,
                                     1e3 * area_m2 * rule.law.toughness_j_m2));
  organ.ties.push_back({rule.name, rule.law, std::move(ties)});
  return {};
}

}  // namespace

Result<JoinedParts> join_parts(const PartFile& file) {
  JoinedParts joined;
  auto& organ = joined.organ;
  organ.name = imported_name(file.source);
  organ.source = file.source.filename().string() + ", " + std::to_string(file.parts.size()) +
                 (file.parts.size() == 1 ? " part" : " parts");
  for (const auto& part : file.parts)
    if (auto s = add_part(file, part, joined); !s) return s.error();
  organ.material = organ.regions.front().material;
  if (std::ranges::all_of(organ.fibre_directions,
                          [](const Vec3d& axis) { return length_squared(axis) == 0; }))
    organ.fibre_directions.clear();
  organ.mesh.build_adjacency();
  organ.source_offset_m = mesh::centre_on_origin(organ.mesh);
  for (const auto& rule : file.ties)
    if (auto s = add_ties(file, rule, joined); !s) return s.error();
  organ.node_masses_kg = organ::lumped_masses(organ);
  if (auto s = validate(organ); !s)
    return Error{ErrorCode::BadFile, file.source.string() + ": " + s.error().message};
  return joined;
}

}  // namespace trocar::catalogue
