#include "server/tissue/propagation/region_borders.h"

#include <algorithm>
#include <numeric>

namespace trocar::propagation {
namespace {

constexpr std::uint32_t kAdd = 1, kRemove = 0u - 1u;

}  // namespace

void RegionBorders::add(Label a, Label b, std::uint32_t depth, std::uint32_t step) {
  const std::uint32_t x = contact_of(a), y = contact_of(b);
  if (a == kNoLabel || b == kNoLabel || x == y) return;
  if (std::min(layer_of(a), layer_of(b)) >= depth) return;
  const std::uint32_t contacts = std::min(x, y) << 16 | std::max(x, y);
  auto it = std::lower_bound(
      borders_.begin(), borders_.end(), contacts,
      [](const Border& border, std::uint32_t wanted) { return border.contacts < wanted; });
  if (it == borders_.end() || it->contacts != contacts) it = borders_.insert(it, {contacts, 0});
  it->edges += step;
}

void RegionBorders::update(const Neighbours& neighbours, const LayeredSearch& search,
                           const LayerLists& before) {
  visited_ = 0;
  // A single contact has no border.
  if (before.contact_capacity() < 2) return;
  if (search.starts_anew()) {
    count_all(neighbours, search);
    return;
  }
  count_changes(neighbours, search);
  if (search.depth() != search.previous_depth())
    count_last_layer(neighbours, search,
                     before.layer(std::min(search.depth(), search.previous_depth())));
  std::erase_if(borders_, [](const Border& border) { return border.edges == 0; });
}

void RegionBorders::count_all(const Neighbours& neighbours, const LayeredSearch& search) {
  for (const auto node : search.contested()) {
    ++visited_;
    for (const auto neighbour : neighbours[node])
      if (node < neighbour || !search.is_contested(neighbour))
        add(search.label(node), search.label(neighbour), search.depth(), kAdd);
  }
}

void RegionBorders::count_changes(const Neighbours& neighbours, const LayeredSearch& search) {
  // Above the last layer a node counts by its contact alone, whatever its layer.
  const auto last_layer = std::min(search.depth(), search.previous_depth());
  const auto counts_anew = [&](Label previous, Label label) {
    return contact_of(previous) != contact_of(label) ||
           (previous != label && std::max(layer_of(previous), layer_of(label)) >= last_layer);
  };
  for (const auto node : search.changed()) {
    const Label label = search.label(node), previous = search.previous_label(node);
    if (!counts_anew(previous, label)) continue;
    ++visited_;
    for (const auto neighbour : neighbours[node]) {
      const Label other = search.label(neighbour);
      const Label other_previous = search.previous_label(neighbour);
      // Nearly all edges lie within a region, before and after.
      if ((contact_of(label ^ other) | contact_of(previous ^ other_previous)) == 0) continue;
      // An edge between two such nodes is seen from both; the lower one counts it.
      if (neighbour < node && counts_anew(other_previous, other)) continue;
      add(previous, other_previous, search.previous_depth(), kRemove);
      add(label, other, search.depth(), kAdd);
    }
  }
}

// Edges within the layer that was the last one count from now on, or the other way round; those at
// changed nodes are done.
void RegionBorders::count_last_layer(const Neighbours& neighbours, const LayeredSearch& search,
                                     std::span<const NodeIndex> layer) {
  for (const auto node : layer) {
    const Label label = search.label(node);
    if (label != search.previous_label(node)) continue;
    ++visited_;
    for (const auto neighbour : neighbours[node]) {
      const Label other = search.label(neighbour);
      if (neighbour < node || other != search.previous_label(neighbour)) continue;
      add(label, other, search.previous_depth(), kRemove);
      add(label, other, search.depth(), kAdd);
    }
  }
}

std::uint16_t RegionBorders::root(std::uint16_t contact) {
  while (parent_[contact] != contact) contact = parent_[contact] = parent_[parent_[contact]];
  return contact;
}

void RegionBorders::merge(std::uint16_t a, std::uint16_t b) {
  a = root(a);
  b = root(b);
  parent_[std::max(a, b)] = std::min(a, b);
}

void RegionBorders::number_regions(Seeds seeds, const LayeredSearch& search,
                                   std::vector<std::uint16_t>& region_of_contact,
                                   std::uint16_t& region_count) {
  parent_.resize(seeds.size());
  std::iota(parent_.begin(), parent_.end(), std::uint16_t{0});
  for (const auto& border : borders_)
    merge(static_cast<std::uint16_t>(border.contacts >> 16),
          static_cast<std::uint16_t>(border.contacts));
  for (std::uint16_t c = 0; c < seeds.size(); ++c)
    for (const auto node : seeds[c]) merge(c, contact_of(search.label(node)));

  region_of_contact.assign(seeds.size(), 0);
  region_count = 0;
  for (std::uint16_t c = 0; c < seeds.size(); ++c) {
    if (seeds[c].empty()) continue;
    const auto r = root(c);
    if (region_of_contact[r] == 0) region_of_contact[r] = ++region_count;
    region_of_contact[c] = region_of_contact[r];
  }
}

}  // namespace trocar::propagation
