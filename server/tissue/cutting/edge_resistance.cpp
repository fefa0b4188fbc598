#include "server/tissue/cutting/edge_resistance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "server/organs/organ/organ.h"

namespace trocar::cutting {
namespace {

// Tissue this far from the edge, m, does not lie against the blade.
constexpr double kNear_m = 0.00125;
// Beyond this distance nothing is near, whatever is rounded.
constexpr double kAside_m = kNear_m + 1e-9;

struct PlaneOfFace {
  Vec3d outward, point;

  double height(const Vec3d& p) const { return dot(outward, p - point); }
};

double distance_squared_to_segment(const Vec3d& from, const Vec3d& to, const Vec3d& p) {
  const Vec3d way = to - from;
  const double t = std::clamp(dot(p - from, way) / length_squared(way), 0.0, 1.0);
  return length_squared(p - (from + way * t));
}

Vec3d any_across(const Vec3d& v) {
  const Vec3d axis = std::abs(v.x) < 0.5 * length(v) ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  return normalized(cross(v, axis), Vec3d{});
}

std::array<Vec3d, 4> corners_of(const CutMesh& mesh, TetIndex tet) {
  std::array<Vec3d, 4> corners;
  const auto& nodes = mesh.topology().tet(tet);
  for (std::size_t i = 0; i < 4; ++i) corners[i] = mesh.position(nodes[i]);
  return corners;
}

// Two directions across the line, and two between these.
std::array<Vec3d, 4> directions_across(const Vec3d& line) {
  const Vec3d a = any_across(line), b = normalized(cross(line, a), Vec3d{});
  const double half = std::sqrt(0.5);
  return {a, b, (a + b) * half, (a - b) * half};
}

// Whether all of a tet lies farther from the line than counts, along one of these directions.
bool lies_aside(const std::array<Vec3d, 4>& corners, const Vec3d& on_line,
                const std::array<Vec3d, 4>& directions) {
  return std::ranges::any_of(directions, [&](const Vec3d& direction) {
    double least = std::numeric_limits<double>::infinity(), most = -least;
    for (const auto& corner : corners) {
      const double aside = dot(direction, corner - on_line);
      least = std::min(least, aside);
      most = std::max(most, aside);
    }
    return least > kAside_m || most < -kAside_m;
  });
}

// The outer sides of a tet's faces, of unit length.
std::array<PlaneOfFace, 4> planes_of(const std::array<Vec3d, 4>& corners) {
  std::array<PlaneOfFace, 4> planes;
  for (std::size_t i = 0; i < 4; ++i) {
    const Vec3d& a = corners[(i + 1) % 4];
    Vec3d normal = cross(corners[(i + 2) % 4] - a, corners[(i + 3) % 4] - a);
    if (dot(normal, corners[i] - a) > 0) normal = -normal;
    planes[i] = {normalized(normal, Vec3d{}), a};
  }
  return planes;
}

// Returns the distance from a tet, 0 inside it.
double distance_to(const std::array<Vec3d, 4>& corners, const std::array<PlaneOfFace, 4>& planes,
                   const Vec3d& p) {
  bool is_inside = true;
  double nearest_squared = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 4; ++i) {
    if (!(planes[i].height(p) > 0)) continue;
    is_inside = false;
    const auto face =
        make_triangle({corners[(i + 1) % 4], corners[(i + 2) % 4], corners[(i + 3) % 4]});
    if (face) nearest_squared = std::min(nearest_squared, distance_squared(*face, p));
  }
  return is_inside ? 0 : std::sqrt(nearest_squared);
}

// The place's barycentric coordinates, or those of a place of the tet near it.
std::array<double, 4> weights_at(const std::array<Vec3d, 4>& corners,
                                 const std::array<PlaneOfFace, 4>& planes, const Vec3d& p) {
  std::array<double, 4> weights;
  double sum = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const double height = -planes[i].height(corners[i]);
    weights[i] = height > 0 ? std::clamp(-planes[i].height(p) / height, 0.0, 1.0) : 0;
    sum += weights[i];
  }
  for (auto& weight : weights) weight = sum > 0 ? weight / sum : 0.25;
  return weights;
}

}  // namespace

void EdgeMeter::find_tets(CutMesh& mesh, const Vec3d& from, const Vec3d& to) {
  nodes_.clear();
  tets_.clear();
  const auto& topology = mesh.topology();
  is_found_.resize(topology.tet_count());
  const auto strip = make_triangle({from, to, (from + to) * 0.5 + any_across(to - from) * kNear_m});
  if (!strip) return;
  mesh.collect({&*strip, 1}, 1, nodes_);
  for (const auto node : nodes_) {
    // A point in a tet is no farther than 0.62 of its longest edge from a corner (Jung), so none is
    // missed in tissue up to 1.6 times as long as at rest; nor one that is kNear_m away, unless its
    // edges are shorter than 3 mm. Of what collect() finds besides nothing may follow: it is no
    // state.
    const double reach = mesh.reach(node);
    if (distance_squared_to_segment(from, to, mesh.position(node)) > reach * reach) continue;
    for (const auto tet : topology.tets_of(node))
      if (std::exchange(is_found_[tet.value], std::uint8_t{1}) == 0) tets_.push_back(tet);
  }
  for (const auto tet : tets_) is_found_[tet.value] = 0;
}

// Tets are looked at in their order, for the lowest of those that are equally near counts.
void EdgeMeter::drop_aside(const CutMesh& mesh, const Vec3d& from, const Vec3d& to) {
  const auto directions = directions_across(to - from);
  std::erase_if(tets_,
                [&](TetIndex tet) { return lies_aside(corners_of(mesh, tet), from, directions); });
  std::sort(tets_.begin(), tets_.end());
}

// Looks at the places on the line that are within kNear_m of all of the tet's planes. Beyond a
// sharp corner these planes go on, so the distance from the tet itself decides.
void EdgeMeter::meet(const std::array<Vec3d, 4>& corners, TetIndex tet, const Vec3d& from,
                     const Vec3d& to) {
  const auto planes = planes_of(corners);
  double begin = 0, end = 1;
  for (const auto& plane : planes) {
    const double at_from = plane.height(from) - kNear_m, at_to = plane.height(to) - kNear_m;
    if (at_from > 0 && at_to > 0) return;
    if (at_from > 0) begin = std::max(begin, at_from / (at_from - at_to));
    if (at_to > 0) end = std::min(end, at_from / (at_from - at_to));
  }
  const double count = static_cast<double>(samples_.size());
  for (double i = std::max(0.0, std::ceil(begin * count - 0.5));
       i < count && (i + 0.5) <= end * count; ++i) {
    const Vec3d place = from + (to - from) * ((i + 0.5) / count);
    auto& sample = samples_[static_cast<std::size_t>(i)];
    if (sample.nearness == 1) continue;
    const double nearness = 1 - distance_to(corners, planes, place) / kNear_m;
    if (nearness > sample.nearness) sample = {nearness, tet, weights_at(corners, planes, place)};
  }
}

// A weighted linear fit; where little of the edge is in tissue, rather the mean.
std::array<Vec3d, 2> EdgeMeter::tissue_motion(const topology::Topology& topology,
                                              std::span<const Vec3f> velocities) const {
  if (velocities.empty()) return {};
  // A part of the edge that is less than about a tenth of it tells no slope; this is squared.
  constexpr double kLeastSpread = 5e-4;
  const auto velocity_of = [&](const Sample& sample) {
    Vec3d velocity;
    const auto& nodes = topology.tet(sample.tet);
    for (std::size_t k = 0; k < 4; ++k)
      velocity += to_double(velocities[nodes[k].value]) * sample.weights[k];
    return velocity;
  };
  const auto place_of = [&](std::size_t i) {
    return (static_cast<double>(i) + 0.5) / static_cast<double>(samples_.size());
  };
  double weight = 0, place = 0;
  Vec3d velocity;
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    if (!(samples_[i].nearness > 0)) continue;
    weight += samples_[i].nearness;
    place += samples_[i].nearness * place_of(i);
    velocity += velocity_of(samples_[i]) * samples_[i].nearness;
  }
  if (!(weight > 0)) return {};
  place /= weight;
  velocity = velocity / weight;
  double spread = kLeastSpread * weight;
  Vec3d slope;
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    if (!(samples_[i].nearness > 0)) continue;
    const double aside = place_of(i) - place;
    spread += samples_[i].nearness * aside * aside;
    slope += (velocity_of(samples_[i]) - velocity) * (samples_[i].nearness * aside);
  }
  slope = slope / spread;
  return {velocity - slope * place, velocity + slope * (1 - place)};
}

EdgeResistance EdgeMeter::measure(CutMesh& mesh, std::span<const Vec3f> velocities,
                                  const Vec3d& from, const Vec3d& to) {
  EdgeResistance sums;
  if (!is_blade(std::array{from, to})) return sums;
  find_tets(mesh, from, to);
  drop_aside(mesh, from, to);
  samples_.fill({});
  const auto& topology = mesh.topology();
  for (const auto tet : tets_) meet(corners_of(mesh, tet), tet, from, to);
  const double length_of_sample = length(to - from) / static_cast<double>(samples_.size());
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const auto& [nearness, tet, _] = samples_[i];
    if (!(nearness > 0)) continue;
    const auto& material = organ::material_at(topology.organ(), topology.material_of(tet));
    const double met_m = nearness * length_of_sample;
    sums.friction_n_m[i / kEdgeSamples] += met_m * material.blade_friction_pa;
    sums.cut_n[i / kEdgeSamples] += met_m * material.cut_energy_j_m2;
    if (topology.wound_faces(tet) == 0) sums.whole_cut_n += met_m * material.cut_energy_j_m2;
  }
  sums.tissue_m_s = tissue_motion(topology, velocities);
  return sums;
}

}  // namespace trocar::cutting
