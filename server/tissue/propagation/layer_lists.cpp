#include "server/tissue/propagation/layer_lists.h"

#include <algorithm>
#include <bit>
#include <numeric>

#include "server/tissue/propagation/layered_search.h"

namespace trocar::propagation {

void LayerLists::resize(std::size_t node_count) {
  nodes_.reserve(node_count);
  new_nodes_.reserve(node_count);
  leaving_.nodes.reserve(node_count);
  entering_.nodes.reserve(node_count);
  bits_.resize((node_count + 63) / 64);
  used_words_.resize((bits_.size() + 63) / 64);
}

void LayerLists::clear(std::size_t contact_capacity) {
  contact_capacity_ = std::max(contact_capacity_, contact_capacity);
  nodes_.clear();
  begins_.assign(1, 0);
}

void LayerLists::Moves::start(std::size_t list_count) {
  begins.assign(list_count + 2, 0);
}

// begins[i + 1] becomes the first place of list i, and, as place() fills the lists, their ends.
void LayerLists::Moves::sum_up() {
  std::partial_sum(begins.begin(), begins.end(), begins.begin());
  nodes.resize(begins.back());
}

// Counting sort by list of nodes that come ascending. No comparison sort: when a contact jumps,
// all nodes are in here.
void LayerLists::sort_moves(const LayeredSearch& search, std::size_t list_count) {
  leaving_.start(begins_.size() - 1);
  entering_.start(list_count);
  for (const auto node : search.changed()) {
    bits_[node.value / 64] |= std::uint64_t{1} << node.value % 64;
    used_words_[node.value / 4096] |= std::uint64_t{1} << node.value / 64 % 64;
    if (const auto label = search.previous_label(node); label != kNoLabel)
      leaving_.count(list_of(label));
    if (const auto label = search.label(node); label != kNoLabel) entering_.count(list_of(label));
  }
  leaving_.sum_up();
  entering_.sum_up();
  for (std::size_t i = 0; i < used_words_.size(); ++i)
    for (; used_words_[i] != 0; used_words_[i] &= used_words_[i] - 1) {
      const auto word = i * 64 + static_cast<std::size_t>(std::countr_zero(used_words_[i]));
      for (; bits_[word] != 0; bits_[word] &= bits_[word] - 1) {
        const NodeIndex node(word * 64 + static_cast<std::size_t>(std::countr_zero(bits_[word])));
        if (const auto label = search.previous_label(node); label != kNoLabel)
          leaving_.place(list_of(label), node);
        if (const auto label = search.label(node); label != kNoLabel)
          entering_.place(list_of(label), node);
      }
    }
}

void LayerLists::append(std::span<const NodeIndex> nodes) {
  new_nodes_.insert(new_nodes_.end(), nodes.begin(), nodes.end());
}

void LayerLists::append_changed(std::span<const NodeIndex> list, std::span<const NodeIndex> leaving,
                                std::span<const NodeIndex> entering) {
  while (!leaving.empty() || !entering.empty()) {
    const bool leaves =
        entering.empty() || (!leaving.empty() && leaving.front() < entering.front());
    const NodeIndex node = leaves ? leaving.front() : entering.front();
    const auto run =
        static_cast<std::size_t>(std::lower_bound(list.begin(), list.end(), node) - list.begin());
    append(list.first(run));
    list = list.subspan(leaves ? run + 1 : run);
    if (!leaves) new_nodes_.push_back(node);
    auto& moves = leaves ? leaving : entering;
    moves = moves.subspan(1);
  }
  append(list);
}

void LayerLists::update(const LayeredSearch& search) {
  const std::size_t list_count = (search.depth() + 1) * contact_capacity_;
  sort_moves(search, list_count);
  const std::size_t lists_before = begins_.size() - 1;
  new_nodes_.clear();
  new_begins_.assign(1, 0);
  for (std::size_t list = 0; list < list_count; ++list) {
    const auto entering = entering_.of(list);
    if (list < lists_before)
      append_changed(range(list, list + 1), leaving_.of(list), entering);
    else
      append(entering);
    new_begins_.push_back(static_cast<std::uint32_t>(new_nodes_.size()));
  }
  std::swap(nodes_, new_nodes_);
  std::swap(begins_, new_begins_);
}

}  // namespace trocar::propagation
