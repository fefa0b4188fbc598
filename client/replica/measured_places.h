#pragma once

// Two places on the surface and the straight line between them. A place is a part of a triangle, so
// it moves with the tissue. Where a cut or a seek takes its triangle away, it goes to the nearest
// one at rest of the same kind, outside or wound; where the tissue was taken out there is none, and
// the place is lost until the tissue is there again.
//
// Thread: render thread.

#include <optional>
#include <span>
#include <vector>

#include "client/replica/drawn_lines.h"

namespace trocar::replica {

class MeasuredPlaces {
 public:
  static constexpr std::size_t kMost = 2;

  // Takes the point of a triangle with these weights of its second and third corner; one more than
  // kMost begins anew.
  void add(std::uint32_t triangle, const std::array<float, 2>& weight, const Topology& topology);
  void clear();
  std::size_t count() const { return places_.size(); }
  // Finds where they are. `version` changes when `topology` does; `positions`: m, per vertex of it.
  void update(const Topology& topology, std::uint64_t version, std::span<const Vec3f> positions);
  // Gives a place each, m; nothing: it is lost.
  std::span<const std::optional<Vec3f>> positions() const { return positions_; }
  // Returns the length of the straight line, m; nothing while there are not two places.
  std::optional<float> distance_m() const;

 private:
  struct Place {
    Attachment at;
    Vec3f rest;  // m
    bool is_wound = false;
  };
  static bool is_valid(const Place& place, const Topology& topology);

  std::vector<Place> places_;
  std::vector<std::optional<Vec3f>> positions_;
  std::uint64_t version_ = 0;  // for which all places were found
};

}  // namespace trocar::replica
