#pragma once

// Finds which contacts' regions overlap. Two contacts reach a common node within the depth limit,
// over any number of contacts between them, exactly if a chain of edges leads from one's nodes to
// the other's, each edge between nodes of two contacts and with an end that is not in the last
// layer: the other end then lies within the depth of both. So the number of such edges per pair of
// contacts is kept, and only edges at changed nodes are counted anew.

#include <cstdint>
#include <span>
#include <vector>

#include "server/tissue/propagation/layered_search.h"

namespace trocar::propagation {

class RegionBorders {
 public:
  void clear() { borders_.clear(); }
  // After a search, before `lists` follow it.
  void update(const Neighbours& neighbours, const LayeredSearch& search, const LayerLists& before);
  // Regions 1, 2, ... by lowest contact, 0 for a contact without seeds.
  void number_regions(Seeds seeds, const LayeredSearch& search,
                      std::vector<std::uint16_t>& region_of_contact, std::uint16_t& region_count);

  std::size_t nodes_visited() const { return visited_; }

 private:
  struct Border {
    std::uint32_t contacts = 0;  // lower << 16 | higher
    std::uint32_t edges = 0;
  };

  void count_all(const Neighbours& neighbours, const LayeredSearch& search);
  void count_changes(const Neighbours& neighbours, const LayeredSearch& search);
  void count_last_layer(const Neighbours& neighbours, const LayeredSearch& search,
                        std::span<const NodeIndex> layer);
  void add(Label a, Label b, std::uint32_t depth, std::uint32_t step);
  std::uint16_t root(std::uint16_t contact);
  void merge(std::uint16_t a, std::uint16_t b);

  std::vector<Border> borders_;        // by contacts, ascending; may have none left
  std::vector<std::uint16_t> parent_;  // union-find over contacts, the lowest is the root
  std::size_t visited_ = 0;
};

}  // namespace trocar::propagation
