#include "common/intake/room.h"

#include <arpa/inet.h>

#include <algorithm>
#include <array>
#include <cstring>

namespace trocar::intake {

std::string counted_as(const std::string& address) {
  in6_addr parsed{};
  const auto text = address.substr(0, address.find('%'));
  if (::inet_pton(AF_INET6, text.c_str(), &parsed) != 1) return address;
  std::array<char, INET6_ADDRSTRLEN> out{};
  if (IN6_IS_ADDR_V4MAPPED(&parsed))
    return ::inet_ntop(AF_INET, parsed.s6_addr + 12, out.data(), out.size());
  std::memset(parsed.s6_addr + 8, 0, 8);
  return std::string(::inet_ntop(AF_INET6, &parsed, out.data(), out.size())) + "/64";
}

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

}  // namespace trocar::intake
