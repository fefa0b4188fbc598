#include "server/organs/surface/closed_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <numeric>

#include "server/organs/mesh/places.h"
#include "server/organs/surface/intersection.h"
#include "server/organs/surface/triangle_tree.h"

namespace trocar::surface {
namespace {

constexpr double kMaxCoordinate_m = 1e9;
constexpr double kNegligible = 0.01;  // share of the volume
constexpr std::size_t kMaxShells = 1000;

struct Edge {
  std::array<NodeIndex, 2> nodes;  // ascending
  std::uint32_t triangle;
  bool is_forward;  // the triangle runs along it from the lower node to the higher
};

class Checker {
 public:
  Checker(RawSurface raw, mesh::Unit unit, const std::string& name)
      : raw_(std::move(raw)), unit_(unit), name_(name) {}

  Result<ClosedSurface> run() {
    vertex_numbers_.resize(raw_.positions.size());
    std::iota(vertex_numbers_.begin(), vertex_numbers_.end(), std::int64_t{1});
    for (auto step :
         {&Checker::scale, &Checker::drop_unused, &Checker::centre, &Checker::weld,
          &Checker::drop_degenerate, &Checker::drop_repeated, &Checker::pair_edges,
          &Checker::orient, &Checker::check_intersections, &Checker::nest, &Checker::keep_one_body})
      if (auto status = (this->*step)(); !status) return status.error();
    for (const auto& [a, b, c] : raw_.triangles) {
      const Vec3d& o = raw_.positions[a.value];
      out_.area_m2 += length(cross(raw_.positions[b.value] - o, raw_.positions[c.value] - o)) / 2;
    }
    out_.positions = std::move(raw_.positions);
    out_.triangles = std::move(raw_.triangles);
    return std::move(out_);
  }

 private:
  Error error(const std::string& what) const { return {ErrorCode::BadFile, name_ + ": " + what}; }
  void warn(std::string what) { out_.warnings.push_back(std::move(what)); }

  std::string place(const Vec3d& centred) const {
    const Vec3d p = (centred + out_.offset_m) / mesh::metres_of(unit_);
    char text[100];
    std::snprintf(text, sizeof text, "(%.6g, %.6g, %.6g)", p.x, p.y, p.z);
    return text;
  }
  std::string edge_name(const Edge& edge) const {
    const auto [a, b] = edge.nodes;
    return "edge from vertex " + std::to_string(vertex_numbers_[a.value]) + " to " +
           std::to_string(vertex_numbers_[b.value]) + " at " +
           place((raw_.positions[a.value] + raw_.positions[b.value]) * 0.5);
  }
  std::int64_t face_number(std::size_t triangle) const { return raw_.face_numbers[triangle]; }

  Status scale() {
    if (raw_.triangles.empty()) return error("has no triangles");
    const double factor = mesh::metres_of(unit_);
    for (std::size_t i = 0; i < raw_.positions.size(); ++i) {
      Vec3d& p = raw_.positions[i];
      p *= factor;
      if (!(std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) <= kMaxCoordinate_m))
        return error("vertex " + std::to_string(i + 1) +
                     " has a coordinate beyond 1e9 m: correct it in the file");
    }
    return {};
  }

  Status drop_unused() {
    std::vector<std::uint8_t> used(raw_.positions.size(), 0);
    for (const auto& triangle : raw_.triangles)
      for (const NodeIndex node : triangle) used[node.value] = 1;
    const auto dropped = std::ranges::count(used, 0);
    keep_vertices(used);
    if (dropped > 0) warn("dropped " + std::to_string(dropped) + " vertices that no face uses");
    return {};
  }

  void keep_vertices(const std::vector<std::uint8_t>& keep) {
    std::vector<std::uint32_t> new_index(keep.size());
    std::uint32_t kept = 0;
    for (std::size_t i = 0; i < keep.size(); ++i) {
      new_index[i] = kept;
      if (!keep[i]) continue;
      raw_.positions[kept] = raw_.positions[i];
      vertex_numbers_[kept++] = vertex_numbers_[i];
    }
    raw_.positions.resize(kept);
    vertex_numbers_.resize(kept);
    for (auto& triangle : raw_.triangles)
      for (NodeIndex& node : triangle) node = NodeIndex(new_index[node.value]);
  }

  void keep_triangles(const std::vector<std::uint8_t>& keep) {
    std::size_t kept = 0;
    for (std::size_t t = 0; t < keep.size(); ++t) {
      if (!keep[t]) continue;
      raw_.triangles[kept] = raw_.triangles[t];
      raw_.face_numbers[kept++] = raw_.face_numbers[t];
    }
    raw_.triangles.resize(kept);
    raw_.face_numbers.resize(kept);
  }

  Status centre() {
    auto done = mesh::centre(raw_.positions, unit_, "vertices");
    if (!done) return error(done.error().message);
    out_.offset_m = done->offset_m;
    if (!done->warning.empty()) warn(std::move(done->warning));
    return {};
  }

  Status weld() {
    const auto welding = mesh::weld(raw_.positions);
    if (welding.welded == 0) return {};
    for (auto& triangle : raw_.triangles)
      for (NodeIndex& node : triangle) node = NodeIndex(welding.first[node.value]);
    keep_vertices(welding.keep);
    warn("welded " + std::to_string(welding.welded) +
         " vertices to others at exactly the same position");
    return {};
  }

  Status drop_degenerate() {
    std::vector<std::uint8_t> keep(raw_.triangles.size());
    for (std::size_t t = 0; t < keep.size(); ++t) {
      const auto& [a, b, c] = raw_.triangles[t];
      keep[t] = a != b && b != c && c != a;
    }
    const auto dropped = std::ranges::count(keep, 0);
    keep_triangles(keep);
    if (dropped > 0)
      warn("dropped " + std::to_string(dropped) + " triangles without three different corners");
    return raw_.triangles.empty() ? Status(error("has no triangles")) : Status{};
  }

  Status drop_repeated() {
    std::vector<std::uint32_t> order(raw_.triangles.size());
    std::iota(order.begin(), order.end(), std::uint32_t{0});
    auto keys = raw_.triangles;
    for (auto& key : keys) std::sort(key.begin(), key.end());
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      return keys[a] != keys[b] ? keys[a] < keys[b] : a < b;
    });
    std::vector<std::uint8_t> keep(keys.size(), 1);
    for (std::size_t i = 1; i < order.size(); ++i)
      keep[order[i]] = keys[order[i]] != keys[order[i - 1]];
    const auto dropped = std::ranges::count(keep, 0);
    keep_triangles(keep);
    if (dropped > 0)
      warn("dropped " + std::to_string(dropped) + " triangles that were listed twice");
    return {};
  }

  // Each edge must have two triangles.
  Status pair_edges() {
    for (std::uint32_t t = 0; t < raw_.triangles.size(); ++t)
      for (std::size_t i = 0; i < 3; ++i) {
        const NodeIndex a = raw_.triangles[t][i], b = raw_.triangles[t][(i + 1) % 3];
        edges_.push_back({{std::min(a, b), std::max(a, b)}, t, a < b});
      }
    std::sort(edges_.begin(), edges_.end(), [](const Edge& a, const Edge& b) {
      return a.nodes != b.nodes ? a.nodes < b.nodes : a.triangle < b.triangle;
    });
    std::size_t open = 0;
    const Edge* first_open = nullptr;
    for (std::size_t i = 0; i < edges_.size();) {
      std::size_t end = i;
      while (end < edges_.size() && edges_[end].nodes == edges_[i].nodes) ++end;
      if (end - i > 2)
        return error("the " + edge_name(edges_[i]) + " belongs to " + std::to_string(end - i) +
                     " faces (" + std::to_string(face_number(edges_[i].triangle)) + ", " +
                     std::to_string(face_number(edges_[i + 1].triangle)) + ", " +
                     std::to_string(face_number(edges_[i + 2].triangle)) +
                     (end - i > 3 ? ", ..." : "") + "), must belong to two: remove the others");
      if (end - i == 1) {
        ++open;
        if (!first_open) first_open = &edges_[i];
      }
      i = end;
    }
    if (open > 0)
      return error("is not closed, " + std::to_string(open) +
                   " edges have a face on one side only, "
                   "the first is the " +
                   edge_name(*first_open) + ": fill the holes");
    return {};
  }

  // Gives neighbours the same side, shell by shell.
  Status orient() {
    const auto count = raw_.triangles.size();
    std::vector<std::array<std::uint32_t, 3>> neighbours(count);
    std::vector<std::array<std::uint8_t, 3>> differs(count);
    std::vector<std::uint8_t> found(count, 0);
    for (std::size_t i = 0; i < edges_.size(); i += 2)
      for (const auto& [from, to] :
           {std::pair(edges_[i], edges_[i + 1]), std::pair(edges_[i + 1], edges_[i])}) {
        const auto slot = found[from.triangle]++;
        neighbours[from.triangle][slot] = to.triangle;
        differs[from.triangle][slot] = from.is_forward == to.is_forward;
      }
    shell_of_.assign(count, kNoShell);
    is_turned_.assign(count, 0);
    std::vector<std::uint32_t> queue;
    for (std::uint32_t seed = 0; seed < count; ++seed) {
      if (shell_of_[seed] != kNoShell) continue;
      if (shells_ == kMaxShells)
        return error("is more than 1,000 separate shells: keep the organ's");
      shell_of_[seed] = shells_;
      queue.assign(1, seed);
      while (!queue.empty()) {
        const auto t = queue.back();
        queue.pop_back();
        for (std::size_t i = 0; i < 3; ++i) {
          const auto n = neighbours[t][i];
          const auto turned = static_cast<std::uint8_t>(is_turned_[t] ^ differs[t][i]);
          if (shell_of_[n] == kNoShell) {
            shell_of_[n] = shells_;
            is_turned_[n] = turned;
            queue.push_back(n);
          } else if (is_turned_[n] != turned) {
            return error("has one side only (as a Moebius strip): no winding fits faces " +
                         std::to_string(face_number(t)) + " and " + std::to_string(face_number(n)));
          }
        }
      }
      ++shells_;
    }
    for (std::size_t t = 0; t < count; ++t)
      if (is_turned_[t]) std::swap(raw_.triangles[t][1], raw_.triangles[t][2]);
    return {};
  }

  Status check_intersections() {
    const TriangleTree tree(raw_.positions, raw_.triangles);
    const auto pairs = intersecting_pairs(raw_.positions, raw_.triangles, tree);
    if (pairs.empty()) return {};
    const auto [a, b] = pairs.front();
    return error(
        "passes through itself, " + std::to_string(pairs.size()) +
        (pairs.size() == 1 ? " pair of faces intersects, " : " pairs of faces intersect, ") +
        "the first are " + std::to_string(face_number(a)) + " and " +
        std::to_string(face_number(b)) + " at " +
        place(raw_.positions[raw_.triangles[a][0].value]) + ": remesh there");
  }

  // How often each shell goes around a point, from the solid angles of its triangles.
  // Van Oosterom, Strackee: The solid angle of a plane triangle, 1983.
  std::vector<double> windings(const Vec3d& p) const {
    std::vector<double> of_shell(shells_, 0);
    for (std::size_t t = 0; t < raw_.triangles.size(); ++t) {
      const Vec3d a = raw_.positions[raw_.triangles[t][0].value] - p,
                  b = raw_.positions[raw_.triangles[t][1].value] - p,
                  c = raw_.positions[raw_.triangles[t][2].value] - p;
      const double la = length(a), lb = length(b), lc = length(c);
      const double angle = 2 * std::atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc +
                                                                   dot(b, c) * la + dot(c, a) * lb);
      of_shell[shell_of_[t]] += angle / (4 * std::numbers::pi);
    }
    return of_shell;
  }

  // Outer shells face outward, cavities inward, and so on.
  Status nest() {
    volume_of_.assign(shells_, 0);
    std::vector<std::uint32_t> first(shells_, kNoShell);
    for (std::uint32_t t = 0; t < raw_.triangles.size(); ++t) {
      const auto& [a, b, c] = raw_.triangles[t];
      volume_of_[shell_of_[t]] +=
          dot(cross(raw_.positions[a.value], raw_.positions[b.value]), raw_.positions[c.value]) / 6;
      if (first[shell_of_[t]] == kNoShell) first[shell_of_[t]] = t;
    }
    parent_.assign(shells_, kNoShell);
    depth_.assign(shells_, 0);
    for (std::uint32_t s = 0; s < shells_; ++s) {
      if (!(std::abs(volume_of_[s]) > 0))
        return error("encloses no volume: it is flat at face " +
                     std::to_string(face_number(first[s])));
      if (shells_ == 1) break;
      const auto around = windings(raw_.positions[raw_.triangles[first[s]][0].value]);
      for (std::uint32_t other = 0; other < shells_; ++other) {
        if (other == s || std::abs(around[other]) < 0.5) continue;
        ++depth_[s];
        if (parent_[s] == kNoShell ||
            std::abs(volume_of_[other]) < std::abs(volume_of_[parent_[s]]))
          parent_[s] = other;
      }
    }
    tell_of_solids_inside();
    std::size_t turned = 0;
    for (std::size_t t = 0; t < raw_.triangles.size(); ++t) {
      const auto s = shell_of_[t];
      const bool faces_out = volume_of_[s] > 0, must_face_out = depth_[s] % 2 == 0;
      if (faces_out != must_face_out) {
        std::swap(raw_.triangles[t][1], raw_.triangles[t][2]);
        is_turned_[t] ^= 1;
      }
      turned += is_turned_[t];
    }
    if (turned > 0)
      warn("turned " + std::to_string(turned) + " of " + std::to_string(raw_.triangles.size()) +
           " triangles whose corners were in mirrored order");
    return {};
  }

  // A cavity's shell faces the other way than the shell around it.
  void tell_of_solids_inside() {
    std::size_t count = 0;
    double volume = 0;
    for (std::uint32_t s = 0; s < shells_; ++s)
      if (depth_[s] % 2 != 0 && (volume_of_[s] > 0) == (volume_of_[parent_[s]] > 0)) {
        ++count;
        volume += std::abs(volume_of_[s]);
      }
    if (count == 0) return;
    char text[200];
    std::snprintf(text, sizeof text,
                  "%zu shells of %.4g ml inside another face outwards, as a solid in a solid does: "
                  "taken as cavities; structures in one another can be told apart in a label map",
                  count, 1e6 * volume);
    warn(text);
  }

  // A body is a shell at even depth with the cavities right inside it.
  Status keep_one_body() {
    std::vector<double> body_volume(shells_, 0);
    const auto body_of = [&](std::uint32_t s) { return depth_[s] % 2 == 0 ? s : parent_[s]; };
    for (std::uint32_t s = 0; s < shells_; ++s)
      body_volume[body_of(s)] += (depth_[s] % 2 == 0 ? 1 : -1) * std::abs(volume_of_[s]);
    const auto largest = static_cast<std::uint32_t>(
        std::max_element(body_volume.begin(), body_volume.end()) - body_volume.begin());
    double all = 0;
    std::size_t bodies = 0;
    for (std::uint32_t s = 0; s < shells_; ++s) {
      if (depth_[s] % 2 != 0) {
        out_.cavities += body_of(s) == largest;
        continue;
      }
      ++bodies;
      all += body_volume[s];
    }
    out_.volume_m3 = body_volume[largest];
    if (bodies == 1) return {};
    if (out_.volume_m3 < (1 - kNegligible) * all)
      return error("is " + std::to_string(bodies) +
                   " separate bodies: an organ made from a surface is one, import them one by one");
    std::vector<std::uint8_t> keep(raw_.triangles.size());
    for (std::size_t t = 0; t < keep.size(); ++t) keep[t] = body_of(shell_of_[t]) == largest;
    keep_triangles(keep);
    warn("dropped " + std::to_string(bodies - 1) +
         " separate bodies that have less than 1 % of the volume");
    std::vector<std::uint8_t> used(raw_.positions.size(), 0);
    for (const auto& triangle : raw_.triangles)
      for (const NodeIndex node : triangle) used[node.value] = 1;
    keep_vertices(used);
    return {};
  }

  static constexpr std::uint32_t kNoShell = 0xffffffffu;

  RawSurface raw_;
  mesh::Unit unit_;
  const std::string& name_;
  std::vector<std::int64_t> vertex_numbers_;  // the file's, from 1
  std::vector<Edge> edges_;
  std::vector<std::uint32_t> shell_of_;  // of each triangle
  std::vector<std::uint8_t> is_turned_;
  std::uint32_t shells_ = 0;
  std::vector<double> volume_of_;              // of each shell, signed by its winding
  std::vector<std::uint32_t> parent_, depth_;  // the smallest shell around; how many are around
  ClosedSurface out_;
};

}  // namespace

Result<ClosedSurface> check_surface(RawSurface raw, mesh::Unit unit, const std::string& name) {
  TROCAR_ASSERT(raw.triangles.size() == raw.face_numbers.size());
  return Checker(std::move(raw), unit, name).run();
}

}  // namespace trocar::surface
