#include "server/tissue/contact/contact_list.h"

namespace trocar::contact {

void ContactList::reserve() {
  // Enough for many tools in contact; beyond it a tick may allocate once more.
  tools.reserve(kMaxTools);
  points.reserve(8 * kMaxPointsPerTool + kMaxSelfPoints);
  self_seeds.reserve(kMaxPointNodes * kMaxSelfPoints);
  seeds.reserve(8 * kMaxPointsPerTool);
  reach_nodes.reserve(8 * kMaxPointsPerTool);
}

void ContactList::clear() {
  tools.clear();
  points.clear();
  seeds.clear();
  self_begin = 0;
  self_seeds.clear();
  reach_nodes.clear();
  reach.fill({0, 0});
  tools_inside = dropped = 0;
}

}  // namespace trocar::contact
