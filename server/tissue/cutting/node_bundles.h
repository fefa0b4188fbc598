#pragma once

// Node bundles find the nodes that are in a box now, without looking at every node.
//
// Nodes are kept in bundles of neighbours, each with the box around its nodes as they were when it
// was last looked into, which holds to as far as nodes have moved since. What is found does not
// depend on the bundles: they only say where nothing can be. So they are no state. A node that is
// made joins the bundle of a parent; one that grows too large is halved.
//
// collect(): O(bundles + nodes of those that may reach the box).

#include <algorithm>
#include <limits>
#include <span>
#include <vector>

#include "common/base/index.h"
#include "common/math/box.h"

namespace trocar::cutting {

using Box = trocar::Box<double>;

class NodeBundles {
 public:
  // Per node: its place at rest, and its reach, any number.
  NodeBundles(std::span<const Vec3d> places, std::span<const double> reaches);

  // Adds to `out`, in no order, nodes whose place(node) is in the box: all but those in a ball
  // (centre, radius) with a greatest reach for which may_hold() is false. travel_m: a sum over
  // ticks of the farthest that any node has moved.
  template <typename Place, typename MayHold>
  void collect(const Box& box, double travel_m, Place&& place, MayHold&& may_hold,
               std::vector<NodeIndex>& out) {
    for (auto& bundle : bundles_) {
      if (!may_reach(bundle, box, travel_m, may_hold)) continue;
      if (const double far = slack(bundle, travel_m);
          far > kMost_m || far > kLoose * bundle.radius()) {
        look_into(bundle, travel_m, place);
        if (!may_reach(bundle, box, travel_m, may_hold)) continue;
      }
      for (const auto node : bundle.nodes)
        if (box.contains(place(node))) out.push_back(node);
    }
  }
  // The place may have belonged to another node.
  template <typename Place>
  void add(NodeIndex node, NodeIndex parent, double reach, double travel_m, Place&& place) {
    remove(node);
    const auto b = bundle_of_[parent.value];
    put_in(node, b);
    bundles_[b].reach = std::max(bundles_[b].reach, reach);
    bundles_[b].box.include(place(node));
    if (bundles_[b].nodes.size() <= kMost) return;
    look_into(bundles_[b], travel_m, place);
    const auto axis = longest_axis(bundles_[b].box);
    halve(b,
          [&](NodeIndex a, NodeIndex c) { return along(place(a), axis) < along(place(c), axis); });
    look_into(bundles_[b], travel_m, place);
    look_into(bundles_.back(), travel_m, place);
  }
  // Nodes may be anywhere.
  void forget();

 private:
  static constexpr std::size_t kMost = 48;
  // A bundle is looked into again when nodes may be so many of its radii outside; and what is
  // slack enough for a bundle to be anywhere, m.
  static constexpr double kLoose = 0.1, kMost_m = 1;
  // m; of floats, and of sums of them.
  static constexpr double kRounding_m = 1e-6, kRounding = 1e-5;

  struct Bundle {
    Box box;
    double travel_m = -std::numeric_limits<double>::infinity();  // when it was looked into
    double reach = 0;
    std::vector<NodeIndex> nodes;

    double radius() const { return length(box.most - box.least) / 2; }
  };

  template <typename MayHold>
  static bool may_reach(const Bundle& bundle, const Box& box, double travel_m, MayHold&& may_hold) {
    const double far = slack(bundle, travel_m);
    if (!bundle.box.overlaps(box, far)) return false;
    return far > kMost_m || bundle.nodes.empty() ||
           may_hold((bundle.box.least + bundle.box.most) / 2, bundle.radius() + far, bundle.reach);
  }
  static double slack(const Bundle& bundle, double travel_m) {
    const double travel = travel_m - bundle.travel_m;
    return travel >= 0 ? travel * (1 + kRounding) + kRounding_m
                       : std::numeric_limits<double>::infinity();
  }
  static int longest_axis(const Box& box);
  static double along(const Vec3d& p, int axis) { return axis == 0 ? p.x : axis == 1 ? p.y : p.z; }
  template <typename Place>
  static void look_into(Bundle& bundle, double travel_m, Place&& place) {
    bundle.box = {};
    for (const auto node : bundle.nodes) bundle.box.include(place(node));
    bundle.travel_m = travel_m;
  }
  // The upper half goes to a new bundle at the end.
  template <typename Less>
  void halve(std::uint32_t b, Less&& less) {
    auto& old = bundles_[b].nodes;
    const auto middle = old.begin() + static_cast<std::ptrdiff_t>(old.size() / 2);
    std::nth_element(old.begin(), middle, old.end(), less);
    const std::vector<NodeIndex> upper(middle, old.end());
    old.erase(middle, old.end());
    const auto next = open_bundle();
    bundles_[next].reach = bundles_[b].reach;
    for (const auto node : upper) put_in(node, next);
  }
  std::uint32_t open_bundle();
  void put_in(NodeIndex node, std::uint32_t b);
  void remove(NodeIndex node);

  std::vector<Bundle> bundles_;
  std::vector<std::uint32_t> bundle_of_;  // per node
};

}  // namespace trocar::cutting
