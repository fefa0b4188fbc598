#include "server/organs/label_map/thin_labels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <queue>

namespace trocar::label_map {
namespace {

// Points along an edge of a tet: one a voxel, within these limits.
constexpr int kLeastSamples = 5, kMostSamples = 20;

int samples_per_edge(const LabelMap& map, const mesh::TetMesh& mesh, double volume_m3) {
  const double voxel =
      std::min({length(map.steps_m[0]), length(map.steps_m[1]), length(map.steps_m[2])});
  // A regular tet of that volume has this edge.
  const double edge = std::cbrt(8.5 * volume_m3 / static_cast<double>(mesh.tets.size()));
  return static_cast<int>(
      std::clamp(std::ceil(edge / voxel), double{kLeastSamples}, double{kMostSamples}));
}

// Volume of each label at each tet, m^3, by points spread evenly in it. A tet has few labels.
using Shares = std::vector<std::vector<std::pair<std::uint16_t, double>>>;

Shares shares_of(const LabelSolid& solid, const mesh::TetMesh& mesh) {
  const int n = samples_per_edge(solid.map(), mesh, solid.volume_m3());
  const double points = n * (n + 1) * (n + 2) / 6.0;
  Shares shares(mesh.tets.size());
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    const double each = tet_volume(mesh, TetIndex(t)) / points;
    for (int a = 0; a < n; ++a)
      for (int b = 0; a + b < n; ++b)
        for (int c = 0; a + b + c < n; ++c) {
          const std::array<double, 4> weights{a + 0.25, b + 0.25, c + 0.25,
                                              n - 1 - a - b - c + 0.25};
          Vec3d p;
          for (std::size_t i = 0; i < 4; ++i)
            p += mesh.rest_positions[mesh.tets[t][i].value] * (weights[i] / n);
          const auto label = solid.label_at(p);
          const auto known =
              std::ranges::find(shares[t], label, &std::pair<std::uint16_t, double>::first);
          if (known == shares[t].end())
            shares[t].emplace_back(label, each);
          else
            known->second += each;
        }
  }
  return shares;
}

// The volume that one label still lacks at each tet, m^3.
class Demand {
 public:
  Demand(const mesh::TetMesh& mesh, const Shares& shares, std::uint16_t label)
      : mesh_(mesh), of_tet_(mesh.tets.size(), 0) {
    for (std::size_t t = 0; t < of_tet_.size(); ++t)
      for (const auto& [of, volume] : shares[t])
        if (of == label) of_tet_[t] = volume;
  }

  double at(std::size_t tet) const { return of_tet_[tet]; }
  double for_its_size(std::size_t tet) const {
    return of_tet_[tet] / tet_volume(mesh_, TetIndex(tet));
  }

  // The label has that tet.
  void pay(std::size_t tet) {
    const double over = tet_volume(mesh_, TetIndex(tet)) - of_tet_[tet];
    of_tet_[tet] = 0;
    double around = 0;
    const auto for_each_around = [&](const auto& visit) {
      for (const NodeIndex node : mesh_.tets[tet])
        for (const TetIndex other : mesh_.node_tets[node]) visit(of_tet_[other.value]);
    };
    // A tet around that shares several nodes is met once for each, and pays the more.
    for_each_around([&](double demand) { around += demand; });
    if (!(around > 0)) return;
    const double share = std::min(over / around, 1.0);
    for_each_around([&](double& demand) { demand -= std::min(demand, share * demand); });
  }

 private:
  const mesh::TetMesh& mesh_;
  std::vector<double> of_tet_;
};

// Tets that may be taken, the one with the greatest demand for its size first.
class Waiting {
 public:
  Waiting(const Demand& demand, const std::vector<std::uint16_t>& tet_labels,
          const std::vector<std::uint16_t>& kept)
      : demand_(demand) {
    for (std::size_t t = 0; t < tet_labels.size(); ++t)
      if (demand.at(t) > 0 && std::ranges::find(kept, tet_labels[t]) == kept.end())
        tets_.emplace(demand.for_its_size(t), t);
  }

  std::optional<std::size_t> next() {
    while (!tets_.empty()) {
      const auto [before, t] = tets_.top();
      tets_.pop();
      const double now = demand_.for_its_size(t);
      if (now == before) return t;
      if (now > 0) tets_.emplace(now, t);  // others have paid from it
    }
    return std::nullopt;
  }

 private:
  const Demand& demand_;
  std::priority_queue<std::pair<double, std::size_t>> tets_;
};

}  // namespace

bool fill_thin_labels(const LabelSolid& solid, const mesh::TetMesh& mesh,
                      const std::vector<std::uint16_t>& labels,
                      std::vector<std::uint16_t>& tet_labels) {
  std::map<std::uint16_t, double> volumes;
  for (std::size_t t = 0; t < tet_labels.size(); ++t)
    volumes[tet_labels[t]] += tet_volume(mesh, TetIndex(t));
  const auto is_short = [&](std::uint16_t label) {
    return volumes[label] < (1 - kMissedVolume) * solid.volume_of(label);
  };
  if (std::ranges::none_of(labels, is_short)) return false;
  const Shares shares = shares_of(solid, mesh);
  std::vector<std::uint16_t> kept;  // labels from which none is taken
  bool has_changed = false;
  for (const auto label : labels) {
    kept.push_back(label);
    if (!is_short(label)) continue;
    Demand demand(mesh, shares, label);
    for (std::size_t t = 0; t < tet_labels.size(); ++t)
      if (tet_labels[t] == label) demand.pay(t);
    Waiting waiting(demand, tet_labels, kept);
    while (const auto t = waiting.next()) {
      const double volume = tet_volume(mesh, TetIndex(*t));
      if (volumes[label] + volume / 2 > solid.volume_of(label)) break;
      volumes[tet_labels[*t]] -= volume;
      volumes[label] += volume;
      tet_labels[*t] = label;
      demand.pay(*t);
      has_changed = true;
    }
  }
  return has_changed;
}

}  // namespace trocar::label_map
