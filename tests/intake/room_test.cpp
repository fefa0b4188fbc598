#include "common/intake/room.h"

#include <gtest/gtest.h>

namespace trocar::intake {
namespace {

TEST(Places, observers_leave_a_tenth_to_who_leads) {
  EXPECT_EQ(places_for_observers(0), 0);
  EXPECT_EQ(places_for_observers(1), 1);
  EXPECT_EQ(places_for_observers(2), 1);
  EXPECT_EQ(places_for_observers(100), 90);
  EXPECT_EQ(places_for_observers(600), 540);
}

TEST(Room, counts_a_household_as_one_address) {
  EXPECT_EQ(counted_as("2001:db8:1:2::7"), counted_as("2001:db8:1:2:ffff::8%eth0"));
  EXPECT_NE(counted_as("2001:db8:1:2::7"), counted_as("2001:db8:1:3::7"));
  EXPECT_EQ(counted_as("::ffff:10.0.0.1"), "10.0.0.1");
  EXPECT_EQ(counted_as("10.0.0.1"), "10.0.0.1");
}

TEST(Room, is_full_of_one_address_before_it_is_full) {
  Room room(3, 2);
  room.enter("10.0.0.1");
  EXPECT_EQ(room.place_for("10.0.0.1"), Room::Place::Free);
  room.enter("10.0.0.1");
  EXPECT_EQ(room.place_for("10.0.0.1"), Room::Place::AddressFull);
  EXPECT_EQ(room.place_for("10.0.0.2"), Room::Place::Free);
  room.enter("2001:db8::1");
  EXPECT_EQ(room.place_for("10.0.0.2"), Room::Place::AllFull);
  room.leave("2001:db8::2");  // of one household
  EXPECT_EQ(room.place_for("10.0.0.2"), Room::Place::Free);
  EXPECT_EQ(room.count(), 2);
}

}  // namespace
}  // namespace trocar::intake
