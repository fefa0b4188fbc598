#pragma once

// The surface of an organ as it meets itself (self_contact.h), through all cuts: its nodes
// ("sites") and triangles, which of them are of a wound, and who is so near to whom that they never
// meet.
//
// Skin (what was surface at first) and wounds are two sorts: a node at a wound's rim is of both,
// and has a normal of each. A node on a wound's front, where both lips begin, is on both sides of
// it: it has no normal of the wound, and meets nothing there by itself.
//
// Near: within kNearLayers, or so many edges' length, through the tissue; where cuts have been,
// along the surface that there is now, so that what they have parted is not near. Both sides of a
// wound start face to face: there only a node's own triangles are near it, those beside them on the
// same side, and those of tets that it is in.
//
// What follows from the edits is a function of them: who follows them has the same. O(what is
// near the edit) each.

#include <array>
#include <span>
#include <vector>

#include "common/base/blocks.h"
#include "common/base/stamps.h"
#include "server/organs/mesh/csr.h"
#include "server/organs/organ/organ.h"
#include "server/tissue/topology/edit.h"
#include "server/tissue/world/world.h"

namespace trocar::contact {

inline constexpr std::uint32_t kNearLayers = 3;

class SelfSurface {
 public:
  using Site = std::uint32_t;  // a surface node's number
  enum class Sort : std::uint8_t { Skin = 0, Wound = 1 };

  explicit SelfSurface(const organ::Organ& organ);

  std::span<const Site> sites() const { return sites_; }  // ascending
  std::size_t node_count() const { return rest_positions_.size(); }
  // Returns the nodes of a triangle, also of one that is gone.
  const std::array<Site, 3>& operator[](TriangleIndex triangle) const {
    return triangles_[triangle.value];
  }
  bool is_gone(TriangleIndex triangle) const { return is_gone_[triangle.value] != 0; }
  Sort sort_of(TriangleIndex triangle) const { return sorts_[triangle.value]; }
  // Returns whether the node is the fourth one of the tet behind the triangle.
  bool is_behind(Site site, TriangleIndex triangle) const {
    return apexes_[triangle.value] == site;
  }
  // Returns whether the node is on the same side of the wound as its triangle, for all that one
  // step along the surface says: it is a corner, or beside one that is not on the front.
  bool shares_side(Site site, TriangleIndex triangle) const;
  // Ascending.
  std::span<const TriangleIndex> triangles_of(Site site) const { return site_triangles_[site]; }
  bool is_of(Site site, Sort sort) const {
    return (site_sorts_[site] >> static_cast<unsigned>(sort) & 1) != 0;
  }
  bool is_of_any(Site site) const { return site_sorts_[site] != 0; }
  // Returns whether the node is on a wound, and on one side of it only.
  bool is_on_lip(Site site) const { return length_squared(rest_wound_normals_[site]) > 0; }

  // Area-weighted, of one sort; zero where a wound's two sides cancel. up_of(triangle): along its
  // normal, twice its area long.
  template <typename UpOf>
  Vec3f normal(Site site, Sort sort, UpOf&& up_of) const {
    Vec3f sum;
    float all = 0;
    for (const auto t : site_triangles_[site]) {
      if (sorts_[t.value] != sort) continue;
      const Vec3f up = up_of(t);
      sum += up;
      if (sort == Sort::Wound) all += length(up);
    }
    if (sort == Sort::Wound && !(length_squared(sum) > kOneSided * kOneSided * all * all))
      return {};
    return normalized(sum, {0, 1, 0});
  }
  template <typename Position>
  Vec3f up(TriangleIndex triangle, Position&& position) const {
    const auto& [a, b, c] = triangles_[triangle.value];
    const Vec3f p = position(a);
    return cross(position(b) - p, position(c) - p);
  }
  std::size_t triangle_count() const { return triangles_.size(); }  // with those that are gone

  const Vec3f& rest_position(Site site) const { return rest_positions_[site]; }
  // Returns whether the skin at one node faced that at the other at rest.
  bool faced_at_rest(Site site, Site across) const;
  // Returns whether the nodes are neighbours on the same side of a wound, or of wounds side by
  // side.
  bool share_lip_at_rest(Site site, Site across) const {
    return dot(rest_wound_normals_[site], rest_wound_normals_[across]) > 0.5f &&
           length_squared(rest_positions_[site] - rest_positions_[across]) < near_m() * near_m();
  }

  // Whether near() has ever been another than at first.
  bool was_cut(Site site) const { return near_states_[site] != NearState::AsAtFirst; }
  std::span<const Site> near(Site site);  // ascending
  bool is_near(Site site, Site across);
  bool is_near(Site site, TriangleIndex triangle);  // any corner
  float near_m() const { return static_cast<float>(near_m_); }

  // These are edge lengths of the surface as it was at first, m.
  float mean_edge_m() const { return mean_edge_m_; }
  float longest_edge_m() const { return longest_edge_m_; }

  // The world has its new nodes.
  void update(const topology::Edit& edit, const world::World& world);
  // Sites of which the last edit has changed triangles, or that was_cut() since it; ascending.
  std::span<const Site> updated() const { return updated_; }

 private:
  enum class NearState : std::uint8_t { AsAtFirst, Unknown, Known };
  // A wound has one side only at a node where the sum of its triangles' area vectors is longer than
  // this part of the sum of their areas.
  static constexpr float kOneSided = 0.3f;

  static constexpr Site kNoSite = 0xffffffffu;

  void add_triangle(const std::array<Site, 3>& sites, Sort sort);
  void find_apexes(const organ::Organ& organ);
  void find_apex(const topology::Topology& topology, TriangleIndex triangle);
  template <typename Neighbours, typename Length>
  void reach(std::span<const Site> from, double near_m, Neighbours&& neighbours,
             Length&& length_between);
  void list_near_at_first(const organ::Organ& organ);
  void reach_along_surface(std::span<const Site> from, double near_m);
  void follow(const topology::SurfaceEdit& edit, const world::World& world);
  void extend(const world::World& world);
  void update_rest(Site site);

  std::vector<Site> sites_;
  std::vector<std::array<Site, 3>> triangles_;
  std::vector<Sort> sorts_;            // per triangle
  std::vector<std::uint8_t> is_gone_;  // per triangle
  std::vector<Site> apexes_;           // per triangle; kNoSite where there are no tets
  // Per node.
  Blocks<TriangleIndex> site_triangles_;
  std::vector<std::uint8_t> site_sorts_;  // bits
  std::vector<Vec3f> rest_positions_, rest_normals_, rest_wound_normals_;
  float mean_edge_m_ = 0, longest_edge_m_ = 0;
  double near_m_ = 0;
  mesh::Csr<NodeIndex, Site> near_at_first_;
  std::vector<NearState> near_states_;
  Blocks<Site> near_now_;
  std::vector<Site> updated_;
  // Scratch of reach().
  Stamps seen_;
  std::vector<double> paths_;
  std::vector<Site> reached_;
  // The path is that of so many edges, whatever a longer chain of shorter ones comes to.
  struct Step {
    Site site = 0;
    double path = 0;
  };
  std::vector<Step> rim_, next_rim_;
};

}  // namespace trocar::contact
