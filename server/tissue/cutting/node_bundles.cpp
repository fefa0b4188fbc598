#include "server/tissue/cutting/node_bundles.h"

namespace trocar::cutting {
namespace {

constexpr std::uint32_t kNone = 0xffffffffu;

}  // namespace

// Halves until the bundles are small enough; half full, for the nodes that cuts make.
NodeBundles::NodeBundles(std::span<const Vec3d> places, std::span<const double> reaches)
    : bundle_of_(places.size(), kNone) {
  open_bundle();
  for (std::uint32_t n = 0; n < places.size(); ++n) put_in(NodeIndex(n), 0);
  const auto place = [&](NodeIndex n) { return places[n.value]; };
  for (std::uint32_t b = 0; b < bundles_.size(); ++b)
    while (bundles_[b].nodes.size() > kMost / 2) {
      look_into(bundles_[b], 0, place);
      const auto axis = longest_axis(bundles_[b].box);
      halve(b, [&](NodeIndex a, NodeIndex c) {
        return along(place(a), axis) < along(place(c), axis);
      });
    }
  for (auto& bundle : bundles_)
    for (const auto node : bundle.nodes) bundle.reach = std::max(bundle.reach, reaches[node.value]);
  forget();
}

void NodeBundles::forget() {
  for (auto& bundle : bundles_) bundle.travel_m = -std::numeric_limits<double>::infinity();
}

int NodeBundles::longest_axis(const Box& box) {
  const auto size = box.most - box.least;
  if (size.x >= size.y && size.x >= size.z) return 0;
  return size.y >= size.z ? 1 : 2;
}

std::uint32_t NodeBundles::open_bundle() {
  bundles_.emplace_back().nodes.reserve(kMost + 1);
  return static_cast<std::uint32_t>(bundles_.size() - 1);
}

void NodeBundles::put_in(NodeIndex node, std::uint32_t b) {
  if (node.value >= bundle_of_.size()) bundle_of_.resize(node.value + 1, kNone);
  bundle_of_[node.value] = b;
  bundles_[b].nodes.push_back(node);
}

void NodeBundles::remove(NodeIndex node) {
  if (node.value >= bundle_of_.size() || bundle_of_[node.value] == kNone) return;
  std::erase(bundles_[bundle_of_[node.value]].nodes, node);
}

}  // namespace trocar::cutting
