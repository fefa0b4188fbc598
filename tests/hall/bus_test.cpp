// An error about a bus may be read by many, and shows no password.

#include "server/hall/bus/bus.h"

#include <gtest/gtest.h>

namespace trocar::hall {
namespace {

TEST(BusUrl, is_said_without_its_passwords) {
  EXPECT_EQ(without_passwords("nats://127.0.0.1:4222"), "nats://127.0.0.1:4222");
  EXPECT_EQ(without_passwords("nats://ada:se@cret@10.0.0.5:4222"), "nats://***@10.0.0.5:4222");
  EXPECT_EQ(without_passwords("nats://a:4222,ada:secret@b:4222,nats://token@c:4222"),
            "nats://a:4222,***@b:4222,nats://***@c:4222");
  EXPECT_EQ(without_passwords(""), "");
}

TEST(BusUrl, is_wrong_in_an_error_that_shows_no_password) {
  const auto bus = Bus::connect("nats://ada:secret@127.0.0.1:1", "test", false);
  ASSERT_FALSE(bus.ok());
  EXPECT_EQ(bus.error().message.find("secret"), std::string::npos) << bus.error().message;
}

}  // namespace
}  // namespace trocar::hall
