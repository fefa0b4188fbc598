#include "server/session/access/room.h"

#include <algorithm>

#include "server/session/access/try_limiter.h"

namespace trocar::access {

int places_for_observers(int places) {
  return places < 2 ? places : places - std::max(1, places / 10);
}

Room::Place Room::place_for(const std::string& address) const {
  const auto found = by_address_.find(counted_as(address));
  if (found != by_address_.end() && found->second >= most_per_address_) return Place::AddressFull;
  return count_ >= most_ ? Place::AllFull : Place::Free;
}

void Room::enter(const std::string& address) {
  ++count_;
  ++by_address_[counted_as(address)];
}

void Room::leave(const std::string& address) {
  --count_;
  const auto found = by_address_.find(counted_as(address));
  if (found != by_address_.end() && --found->second <= 0) by_address_.erase(found);
}

}  // namespace trocar::access
