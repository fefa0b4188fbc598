#include "server/tissue/propagation/seed_set.h"

#include <algorithm>

#include "common/base/assert.h"

namespace trocar::propagation {

void SeedSet::resize(std::size_t node_count) {
  contacts_.resize(node_count, kNoContact);
  is_named_.resize(node_count);
}

bool SeedSet::equals(Seeds seeds) const {
  if (seeds.size() != ends_.size()) return false;
  std::uint32_t begin = 0;
  for (std::size_t c = 0; c < seeds.size(); ++c) {
    if (seeds[c].size() != ends_[c] - begin ||
        !std::equal(seeds[c].begin(), seeds[c].end(), nodes_.begin() + begin))
      return false;
    begin = ends_[c];
  }
  return true;
}

void SeedSet::replace(Seeds seeds) {
  TROCAR_ASSERT(seeds.size() < kNoContact);
  is_named_.begin();
  std::swap(nodes_, previous_nodes_);
  nodes_.clear();
  ends_.clear();
  changes_.clear();
  for (std::size_t c = 0; c < seeds.size(); ++c) {
    for (const auto node : seeds[c]) {
      if (!is_named_.insert(node.value)) continue;
      auto& contact = contacts_[node.value];
      const auto now = static_cast<std::uint16_t>(c);
      if (contact != now) changes_.push_back({node, contact, now});
      contact = now;
    }
    nodes_.insert(nodes_.end(), seeds[c].begin(), seeds[c].end());
    ends_.push_back(static_cast<std::uint32_t>(nodes_.size()));
  }
  for (const auto node : previous_nodes_) {
    auto& contact = contacts_[node.value];
    if (is_named_.has(node.value) || contact == kNoContact) continue;
    changes_.push_back({node, contact, kNoContact});
    contact = kNoContact;
  }
}

}  // namespace trocar::propagation
