#include "server/tissue/cutting/subdivision.h"

#include <algorithm>
#include <numeric>
#include <tuple>
#include <utility>

namespace trocar::cutting {
namespace {

constexpr int kRounds = 2;
constexpr double kGain = 1e-9;  // of a sum of sines; less is rounding

// A tet with a node of its own for each cut edge, bisected one after another.
class Parts {
 public:
  Parts(const std::array<Vec3d, 4>& corners, const mesh::Tet& tet) : tet_(tet) {
    std::copy(corners.begin(), corners.end(), places_.begin());
    parts_[0] = {0, 1, 2, 3};
  }
  void bisect(const EdgeCut& cut) {
    const std::uint8_t a = corner_of(tet_, cut.a), b = corner_of(tet_, cut.b);
    const auto node = node_count_++;
    places_[node] = cut.place;
    for (std::size_t i = 0, end = count_; i < end; ++i) {
      auto& part = parts_[i];
      const auto at_a = std::ranges::find(part, a), at_b = std::ranges::find(part, b);
      if (at_a == part.end() || at_b == part.end()) continue;
      auto& other = parts_[count_++];
      other = part;
      other[static_cast<std::size_t>(at_a - part.begin())] = node;
      *at_b = node;
    }
  }
  double least() const {
    double least = 1;
    for (std::size_t i = 0; i < count_; ++i) {
      std::array<Vec3d, 4> corners;
      for (std::size_t c = 0; c < 4; ++c) corners[c] = places_[parts_[i][c]];
      least = std::min(least, least_sine(corners));
    }
    return least;
  }

 private:
  // Six edges give at most 2^6 parts.
  const mesh::Tet& tet_;
  std::array<Vec3d, 10> places_;
  std::array<std::array<std::uint8_t, 4>, 64> parts_;
  std::size_t count_ = 1;
  std::uint8_t node_count_ = 4;
};

}  // namespace

void Subdivision::find_tets(const topology::Topology& topology) {
  std::vector<std::pair<TetIndex, std::uint32_t>> pairs;
  std::vector<TetIndex> ring;
  for (std::uint32_t c = 0; c < cuts_.size(); ++c) {
    ring_of(topology, cuts_[c].a, cuts_[c].b, ring);
    for (const auto tet : ring) pairs.emplace_back(tet, c);
  }
  std::sort(pairs.begin(), pairs.end());
  tets_.clear();
  tets_of_.assign(cuts_.size(), {});
  for (const auto& [tet, cut] : pairs) {
    if (tets_.empty() || tets_.back().tet != tet) tets_.push_back({tet, {}});
    tets_.back().cuts.push_back(cut);
    tets_of_[cut].push_back(static_cast<std::uint32_t>(tets_.size() - 1));
  }
}

void Subdivision::rank_by_length(const topology::Topology& topology) {
  const auto rest = topology.rest();
  const auto key = [&](std::uint32_t c) {
    const auto& cut = cuts_[c];
    return std::tuple(-length_squared(rest[cut.b.value] - rest[cut.a.value]), cut.a, cut.b);
  };
  order_.resize(cuts_.size());
  std::iota(order_.begin(), order_.end(), 0u);
  std::sort(order_.begin(), order_.end(), [&](auto x, auto y) { return key(x) < key(y); });
  ranks_.resize(cuts_.size());
  for (std::uint32_t r = 0; r < order_.size(); ++r) ranks_[order_[r]] = r;
}

double Subdivision::score(const topology::Topology& topology, const CutTet& cut_tet) {
  own_ = cut_tet.cuts;
  std::sort(own_.begin(), own_.end(), [&](auto x, auto y) { return ranks_[x] < ranks_[y]; });
  const auto& tet = topology.tet(cut_tet.tet);
  Parts parts(rest_corners(topology, tet), tet);
  for (const auto c : own_) parts.bisect(cuts_[c]);
  return parts.least();
}

double Subdivision::score_around(const topology::Topology& topology) {
  double sum = 0;
  for (const auto t : around_) sum += score(topology, tets_[t]);
  return sum;
}

bool Subdivision::improve(const topology::Topology& topology, const CutTet& cut_tet) {
  around_.clear();
  std::vector<std::uint32_t> ranks, best;
  for (const auto c : cut_tet.cuts) {
    best.push_back(ranks_[c]);
    for (const auto t : tets_of_[c])
      if (tets_[t].cuts.size() > 1) around_.push_back(t);
  }
  std::sort(around_.begin(), around_.end());
  around_.erase(std::unique(around_.begin(), around_.end()), around_.end());
  ranks = best;
  std::sort(ranks.begin(), ranks.end());
  const auto take = [&](const std::vector<std::uint32_t>& given) {
    for (std::size_t i = 0; i < given.size(); ++i) ranks_[cut_tet.cuts[i]] = given[i];
  };
  double most = score_around(topology);
  bool is_better = false;
  do {
    take(ranks);
    const double sum = score_around(topology);
    if (!(sum > most + kGain)) continue;
    most = sum;
    best = ranks;
    is_better = true;
  } while (std::next_permutation(ranks.begin(), ranks.end()));
  take(best);
  return is_better;
}

std::span<const std::uint32_t> Subdivision::order(const topology::Topology& topology,
                                                  std::span<const EdgeCut> cuts) {
  cuts_ = cuts;
  find_tets(topology);
  rank_by_length(topology);
  bool is_better = true;
  for (int round = 0; round < kRounds && is_better; ++round) {
    is_better = false;
    for (const auto& cut_tet : tets_)
      if (cut_tet.cuts.size() > 1 && cut_tet.cuts.size() <= 4)
        is_better = improve(topology, cut_tet) || is_better;
  }
  std::sort(order_.begin(), order_.end(), [&](auto x, auto y) { return ranks_[x] < ranks_[y]; });
  return order_;
}

}  // namespace trocar::cutting
