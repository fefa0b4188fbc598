#include "client/replica/measured_places.h"

namespace trocar::replica {
namespace {

constexpr float kSameMetres = 1e-5f;  // below a step of the grid that positions are sent on

Vec3f point_of(const Attachment& at, const Topology& topology, std::span<const Vec3f> positions) {
  const auto& corners = topology.triangles[at.triangle];
  const Vec3f a = positions[corners[0]];
  return a + (positions[corners[1]] - a) * at.weight[0] +
         (positions[corners[2]] - a) * at.weight[1];
}

}  // namespace

void MeasuredPlaces::add(std::uint32_t triangle, const std::array<float, 2>& weight,
                         const Topology& topology) {
  if (triangle >= topology.triangles.size()) return;
  if (places_.size() == kMost) clear();
  const Attachment at{triangle, weight, 0};
  places_.push_back(
      {at, point_of(at, topology, topology.rest_positions), topology.is_wound[triangle] != 0});
}

void MeasuredPlaces::clear() {
  places_.clear();
  positions_.clear();
}

// Another epoch may have another triangle at the same index.
bool MeasuredPlaces::is_valid(const Place& place, const Topology& topology) {
  const auto triangle = place.at.triangle;
  if (triangle >= topology.triangles.size() || place.at.distance_m > kLostMetres) return false;
  const auto& corners = topology.triangles[triangle];
  if (corners[0] == corners[1] || (topology.is_wound[triangle] != 0) != place.is_wound)
    return false;
  const Vec3f rest = point_of(place.at, topology, topology.rest_positions);
  return length(rest - place.rest) <= place.at.distance_m + kSameMetres;
}

void MeasuredPlaces::update(const Topology& topology, std::uint64_t version,
                            std::span<const Vec3f> positions) {
  positions_.assign(places_.size(), std::nullopt);
  if (positions.size() != topology.rest_positions.size()) return;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    Place& place = places_[i];
    if (version != version_ && !is_valid(place, topology))
      place.at = attach(place.rest, topology, topology.rest_positions, place.is_wound);
    if (place.at.triangle != kNoTriangle && place.at.distance_m <= kLostMetres)
      positions_[i] = point_of(place.at, topology, positions);
  }
  version_ = version;
}

std::optional<float> MeasuredPlaces::distance_m() const {
  if (positions_.size() < kMost || !positions_[0] || !positions_[1]) return std::nullopt;
  return length(*positions_[1] - *positions_[0]);
}

}  // namespace trocar::replica
