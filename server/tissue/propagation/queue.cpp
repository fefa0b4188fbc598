#include "server/tissue/propagation/queue.h"

#include <algorithm>

namespace trocar::propagation {

PropagationQueue::PropagationQueue(std::size_t node_count) {
  resize(node_count);
}

void PropagationQueue::resize(std::size_t node_count) {
  node_capacity_ = node_count;
  seeds_.resize(node_count);
  search_.resize(node_count);
  lists_.resize(node_count);
  nodes_.reserve(node_count);
}

bool PropagationQueue::is_repeated(const Neighbours& neighbours, Seeds seeds,
                                   const QueueLimits& limits) {
  const auto& items = neighbours.table().items;
  if (items.data() != table_ || items.size() != table_items_ ||
      neighbours.row_count() != table_rows_) {
    table_ = items.data();
    table_items_ = items.size();
    table_rows_ = neighbours.row_count();
    if (table_rows_ > node_capacity_) resize(table_rows_);
    has_history_ = false;
  }
  return has_history_ && limits == limits_ && seeds_.equals(seeds);
}

void PropagationQueue::start_anew(std::size_t contact_count) {
  search_.clear(lists_.nodes());
  lists_.clear(contact_count);
  borders_.clear();
}

void PropagationQueue::fill(const Neighbours& neighbours, Seeds seeds, const QueueLimits& limits) {
  visited_ = 0;
  if (is_repeated(neighbours, seeds, limits)) return;
  seeds_.replace(seeds);
  limits_ = limits;
  if (!has_history_ || seeds.size() > lists_.contact_capacity()) {
    start_anew(seeds.size());
  } else if (!search_.retract(neighbours, seeds_, lists_)) {
    visited_ = search_.nodes_visited();
    start_anew(seeds.size());
  }
  has_history_ = true;
  search_.advance(neighbours, seeds_, limits, lists_);
  borders_.update(neighbours, search_, lists_);
  borders_.number_regions(seeds, search_, region_of_contact_, region_count_);
  lists_.update(search_);
  order(seeds.size(), limits.nodes);
  visited_ += search_.nodes_visited() + borders_.nodes_visited();
}

void PropagationQueue::order(std::size_t contact_count, std::uint32_t node_limit) {
  nodes_.clear();
  layer_offsets_.assign(1, 0);
  share_ends_.assign(contact_count, 0xffffffffu);
  for (std::size_t layer = 0; layer < lists_.layer_count(); ++layer) {
    fill_in_turns(layer, contact_count, node_limit - nodes_.size());
    layer_offsets_.push_back(static_cast<std::uint32_t>(nodes_.size()));
  }
  const bool is_cut = nodes_.size() < lists_.nodes().size();
  whole_end_ = kOneLayer * (is_cut ? search_.depth() : search_.depth() + 1);
}

void PropagationQueue::fill_in_turns(std::size_t layer, std::size_t contact_count,
                                     std::size_t room) {
  turns_.clear();
  for (std::size_t c = 0; c < contact_count; ++c)
    if (const auto share = lists_.share(layer, c); !share.empty())
      turns_.push_back({share, static_cast<std::uint16_t>(c)});
  while (turns_.size() > 1 && room >= turns_.size()) {
    for (auto& turn : turns_) {
      nodes_.push_back(turn.nodes.front());
      turn.nodes = turn.nodes.subspan(1);
    }
    room -= turns_.size();
    std::erase_if(turns_, [](const Turn& turn) { return turn.nodes.empty(); });
  }
  // A single contact gives all its nodes at once; of several, the room is not for one each.
  for (auto& turn : turns_) {
    const std::size_t count =
        turns_.size() == 1 ? std::min(room, turn.nodes.size()) : std::min<std::size_t>(room, 1);
    nodes_.insert(nodes_.end(), turn.nodes.begin(), turn.nodes.begin() + count);
    room -= count;
    if (count < turn.nodes.size()) share_ends_[turn.contact] = turn.nodes[count].value;
  }
}

}  // namespace trocar::propagation
