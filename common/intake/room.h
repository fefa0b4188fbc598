#pragma once

// How many there is room for, in all and of each address. A session is led by somebody, so that
// those who look on never fill a door. Thread: one.

#include <map>
#include <string>

namespace trocar::intake {

// "2001:db8:1:2::/64" for "2001:db8:1:2::7", which is what one household has; other addresses as
// they are; an IPv4 address that is written as IPv6 counts as IPv4.
std::string counted_as(const std::string& address);

// Returns how many of so many places observers may have.
int places_for_observers(int places);

// Counts who is in, in all and of each address (counted_as()).
class Room {
 public:
  Room(int most, int most_per_address) : most_(most), most_per_address_(most_per_address) {}

  // One more finds place, or there is none left for an address, or for anybody.
  enum class Place { Free, AddressFull, AllFull };
  Place place_for(const std::string& address) const;
  void enter(const std::string& address);
  void leave(const std::string& address);
  int count() const { return count_; }

 private:
  int most_, most_per_address_, count_ = 0;
  std::map<std::string, int> by_address_;
};

}  // namespace trocar::intake
