#include "server/tissue/contact/self_contact_table.h"

#include <algorithm>
#include <cmath>

#include "server/tissue/contact/contact_list.h"

namespace trocar::contact {
namespace {

bool is_place(const SelfContactPlace& place) {
  const auto& w = place.weights;
  return w.x >= 0 && w.y >= 0 && w.z >= 0 && std::abs(w.x + w.y + w.z - 1) < 1e-4f &&
         std::abs(length_squared(place.normal) - 1) < 1e-3f &&
         std::abs(place.shift) <= 2 * (kOverlapAtRest_m + kDeepest_m);
}

}  // namespace

SelfContactTable::SelfContactTable() {
  nodes_.reserve(kMaxSelfPoints);
  triangles_.reserve(kMaxSelfPoints);
  places_.reserve(kMaxSelfPoints);
}

void SelfContactTable::visit_state(world::StateArchive& archive,
                                   std::span<const NodeIndex> surface_nodes,
                                   std::size_t triangle_count) {
  archive.value(last_pass_);
  archive.value(has_edit_);
  if (archive.is_reading()) {
    clear();
    if (archive.at_end()) return;
  } else if (nodes_.empty()) {
    return;
  }
  archive.sized_array(nodes_, kMaxSelfPoints);
  archive.sized_array(triangles_, kMaxSelfPoints);
  archive.sized_array(places_, kMaxSelfPoints);
  if (!archive.is_reading()) return;
  bool is_good = !nodes_.empty() && nodes_.size() == triangles_.size() &&
                 nodes_.size() == places_.size() && std::ranges::all_of(places_, is_place);
  for (std::size_t i = 0; is_good && i < nodes_.size(); ++i)
    is_good = std::ranges::binary_search(surface_nodes, nodes_[i]) &&
              triangles_[i].value < triangle_count && (i == 0 || nodes_[i - 1] < nodes_[i]);
  if (is_good) return;
  archive.fail();
  clear();
}

}  // namespace trocar::contact
