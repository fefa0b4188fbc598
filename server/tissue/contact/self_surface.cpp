#include "server/tissue/contact/self_surface.h"

#include <algorithm>

namespace trocar::contact {
namespace {

constexpr double kNearEdges = 3.5;
constexpr std::uint32_t kMostNearLayers = 8;
constexpr float kFacing_m = 2e-6f;
constexpr double kRounding = 1e-12;  // of lengths added up from the other end

}  // namespace

SelfSurface::SelfSurface(const organ::Organ& organ) {
  extend(world::World(organ));
  for (const auto node : organ.mesh.surface_nodes) sites_.push_back(node.value);
  std::ranges::sort(sites_);
  double edges = 0;
  for (const auto& nodes : organ.mesh.boundary_triangles) {
    const std::array<Site, 3> sites{nodes[0].value, nodes[1].value, nodes[2].value};
    for (std::size_t k = 0; k < 3; ++k) {
      const float edge = length(rest_positions_[sites[k]] - rest_positions_[sites[(k + 1) % 3]]);
      edges += static_cast<double>(edge);
      longest_edge_m_ = std::max(longest_edge_m_, edge);
    }
    add_triangle(sites, Sort::Skin);
  }
  find_apexes(organ);
  site_triangles_.end_building();
  near_now_.end_building();
  const auto corners = static_cast<double>(std::max<std::size_t>(1, 3 * triangles_.size()));
  mean_edge_m_ = static_cast<float>(edges / corners);
  near_m_ = kNearEdges * static_cast<double>(mean_edge_m_);
  for (const Site s : sites_) update_rest(s);
  list_near_at_first(organ);
}

void SelfSurface::extend(const world::World& world) {
  const auto before = rest_positions_.size(), now = world.node_count();
  if (now == before) return;
  rest_positions_.insert(rest_positions_.end(),
                         world.rest_positions.begin() + static_cast<std::ptrdiff_t>(before),
                         world.rest_positions.end());
  rest_normals_.resize(now);
  rest_wound_normals_.resize(now);
  site_sorts_.resize(now);
  site_triangles_.extend(now);
  near_now_.extend(now);
  near_states_.resize(now);
  seen_.resize(now);
  paths_.resize(now);
}

void SelfSurface::add_triangle(const std::array<Site, 3>& sites, Sort sort) {
  const TriangleIndex triangle(triangles_.size());
  triangles_.push_back(sites);
  sorts_.push_back(sort);
  is_gone_.push_back(0);
  apexes_.push_back(kNoSite);
  for (const Site s : sites) {
    const auto count = static_cast<std::uint32_t>(site_triangles_[s].size());
    site_triangles_.resize(s, count + 1).back() = triangle;
  }
}

void SelfSurface::find_apexes(const organ::Organ& organ) {
  struct Face {
    std::array<Site, 3> key;  // ascending
    Site apex;
  };
  std::vector<Face> faces;
  faces.reserve(4 * organ.mesh.tets.size());
  for (const auto& tet : organ.mesh.tets)
    for (std::size_t apex = 0; apex < 4; ++apex) {
      Face face{.apex = tet[apex].value};
      for (std::size_t i = 0, at = 0; i < 4; ++i)
        if (i != apex) face.key[at++] = tet[i].value;
      std::ranges::sort(face.key);
      faces.push_back(face);
    }
  std::ranges::sort(faces, {}, &Face::key);
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    auto key = triangles_[t];
    std::ranges::sort(key);
    const auto face = std::ranges::lower_bound(faces, key, {}, &Face::key);
    if (face != faces.end() && face->key == key) apexes_[t] = face->apex;
  }
}

void SelfSurface::find_apex(const topology::Topology& topology, TriangleIndex triangle) {
  const auto& sites = triangles_[triangle.value];
  for (const auto t : topology.tets_of(NodeIndex(sites[0]))) {
    const auto& tet = topology.tet(t);
    Site apex = kNoSite;
    std::size_t shared = 0;
    for (const auto node : tet)
      if (std::ranges::find(sites, node.value) != sites.end())
        ++shared;
      else
        apex = node.value;
    if (shared == 3) apexes_[triangle.value] = apex;
  }
}

// Derives a node's sorts and rest normals from its triangles. The normal of skin is set once: skin
// that was there at first faces what it faced then.
void SelfSurface::update_rest(Site site) {
  const auto at_rest = [this](TriangleIndex t) {
    return up(t, [this](Site s) { return rest_positions_[s]; });
  };
  site_sorts_[site] = 0;
  for (const auto t : site_triangles_[site])
    site_sorts_[site] =
        static_cast<std::uint8_t>(site_sorts_[site] | 1u << static_cast<unsigned>(sorts_[t.value]));
  if (is_of(site, Sort::Skin) && length_squared(rest_normals_[site]) == 0)
    rest_normals_[site] = normal(site, Sort::Skin, at_rest);
  rest_wound_normals_[site] =
      is_of(site, Sort::Wound) ? normal(site, Sort::Wound, at_rest) : Vec3f{};
}

// From `from` along edges, into reached_: within kNearLayers of them, or along kMostNearLayers that
// are together near_m long at most. neighbours(node, visit), length_between(a, b).
template <typename Neighbours, typename Length>
void SelfSurface::reach(std::span<const Site> from, double near_m, Neighbours&& neighbours,
                        Length&& length_between) {
  reached_.assign(from.begin(), from.end());
  seen_.begin();
  for (const Site s : from) seen_.insert(s), paths_[s] = 0;
  rim_.clear();
  for (const Site s : from) rim_.push_back({s, 0});
  for (std::uint32_t layer = 1; !rim_.empty() && layer <= kMostNearLayers; ++layer) {
    next_rim_.clear();
    for (const Step& step : rim_)
      neighbours(step.site, [&](Site next) {
        const double path = step.path + length_between(step.site, next);
        const bool is_new = !seen_.has(next);
        if ((layer > kNearLayers && path > near_m) || !(is_new || path < paths_[next])) return;
        paths_[next] = path;
        next_rim_.push_back({next, path});
        if (seen_.insert(next)) reached_.push_back(next);
      });
    std::swap(rim_, next_rim_);
  }
  std::ranges::sort(reached_);
}

// Along edges in the tissue, so that both faces of a thin wall are near each other.
void SelfSurface::list_near_at_first(const organ::Organ& organ) {
  const auto& mesh = organ.mesh;
  near_at_first_.offsets.assign(1, 0);
  for (std::uint32_t n = 0; n < mesh.node_count(); ++n) {
    if (is_of_any(n)) {
      reach(
          {&n, 1}, near_m_,
          [&](Site from, auto&& visit) {
            for (const auto node : mesh.node_neighbours[NodeIndex(from)]) visit(node.value);
          },
          [&](Site a, Site b) { return length(mesh.rest_positions[b] - mesh.rest_positions[a]); });
      for (const Site s : reached_)
        if (is_of_any(s)) near_at_first_.items.push_back(s);
    }
    near_at_first_.offsets.push_back(static_cast<std::uint32_t>(near_at_first_.items.size()));
  }
}

void SelfSurface::reach_along_surface(std::span<const Site> from, double near_m) {
  reach(
      from, near_m,
      [this](Site site, auto&& visit) {
        for (const auto t : site_triangles_[site])
          for (const Site s : triangles_[t.value])
            if (s != site) visit(s);
      },
      [this](Site a, Site b) {
        return static_cast<double>(length(rest_positions_[b] - rest_positions_[a]));
      });
}

std::span<const SelfSurface::Site> SelfSurface::near(Site site) {
  if (near_states_[site] == NearState::AsAtFirst) return near_at_first_[NodeIndex(site)];
  if (near_states_[site] == NearState::Unknown) {
    near_states_[site] = NearState::Known;
    reach_along_surface({&site, 1}, near_m_);
    std::ranges::copy(reached_,
                      near_now_.resize(site, static_cast<std::uint32_t>(reached_.size())).begin());
  }
  return near_now_[site];
}

bool SelfSurface::is_near(Site site, Site across) {
  return std::ranges::binary_search(near(site), across);
}

bool SelfSurface::is_near(Site site, TriangleIndex triangle) {
  const auto near_site = near(site);
  return std::ranges::any_of(triangles_[triangle.value], [&](Site corner) {
    return std::ranges::binary_search(near_site, corner);
  });
}

bool SelfSurface::shares_side(Site site, TriangleIndex triangle) const {
  const auto is_beside = [&](Site corner) {
    const auto around = site_triangles_[corner];
    return is_on_lip(corner) && std::any_of(around.begin(), around.end(), [&](TriangleIndex t) {
             return std::ranges::find(triangles_[t.value], site) != triangles_[t.value].end();
           });
  };
  const auto& corners = triangles_[triangle.value];
  return std::ranges::find(corners, site) != corners.end() ||
         std::ranges::any_of(corners, is_beside);
}

bool SelfSurface::faced_at_rest(Site site, Site across) const {
  const Vec3f way = rest_positions_[across] - rest_positions_[site];
  const Vec3f &own = rest_normals_[site], &theirs = rest_normals_[across];
  return dot(own, theirs) < 0 && dot(way, own) >= -kFacing_m && dot(way, theirs) <= kFacing_m;
}

void SelfSurface::update(const topology::Edit& edit, const world::World& world) {
  follow(edit.surface, world);
  for (const auto node : edit.topology.changed())
    if (node.value < node_count())
      for (const auto triangle : site_triangles_[node.value]) find_apex(edit.topology, triangle);
}

void SelfSurface::follow(const topology::SurfaceEdit& edit, const world::World& world) {
  updated_.clear();
  if (edit.touched.empty()) return;
  extend(world);
  for (const auto triangle : edit.removed) {
    is_gone_[triangle.value] = 1;
    for (const Site s : triangles_[triangle.value]) {
      const auto list = site_triangles_[s];
      std::copy(std::ranges::find(list, triangle) + 1, list.end(),
                std::ranges::find(list, triangle));
      site_triangles_.resize(s, static_cast<std::uint32_t>(list.size() - 1));
    }
  }
  for (const auto& added : edit.added)
    add_triangle({added.nodes[0].value, added.nodes[1].value, added.nodes[2].value},
                 added.is_wound ? Sort::Wound : Sort::Skin);
  const auto middle = static_cast<std::ptrdiff_t>(sites_.size());
  for (const auto node : edit.surfaced) sites_.push_back(node.value);
  std::inplace_merge(sites_.begin(), sites_.begin() + middle, sites_.end());
  sites_.erase(std::unique(sites_.begin(), sites_.end()), sites_.end());
  for (const auto node : edit.touched) {
    update_rest(node.value);
    updated_.push_back(node.value);
  }
  // Whoever had one of them near, or has now: a way that has changed leads through them, and is as
  // it was up to the first.
  reach_along_surface(updated_, near_m_ * (1 + kRounding));
  for (const Site s : reached_) {
    if (near_states_[s] == NearState::AsAtFirst) updated_.push_back(s);
    near_states_[s] = NearState::Unknown;
  }
  std::ranges::sort(updated_);
  updated_.erase(std::unique(updated_.begin(), updated_.end()), updated_.end());
  site_triangles_.tidy();
  near_now_.tidy();
}

}  // namespace trocar::contact
