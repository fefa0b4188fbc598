#include "client/device/haply_device.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "client/device/haply_messages.h"
#include "tests/device/device_bench.h"
#include "tests/device/fake_haply.h"

namespace trocar::device {
namespace {

using testing::eventually;
using testing::FakeHaply;

Vec3d force_in(const std::string& message) {
  const auto json = nlohmann::json::parse(message);
  const auto& device = json["inverse3"][0];
  EXPECT_EQ(device["device_id"], "049D");
  const auto& values = device["commands"]["set_cursor_force"]["values"];
  return {values["x"].get<double>(), values["y"].get<double>(), values["z"].get<double>()};
}

std::unique_ptr<HapticDevice> open(const FakeHaply& service) {
  auto opened = HaplyDevice::open(service.url(), std::chrono::seconds(30));
  EXPECT_TRUE(opened.ok()) << opened.error().message;
  return std::move(*opened);
}

// True once the device is gone, with advice.
bool is_gone(HapticDevice& device) {
  return eventually([&] {
    const auto reading = device.read();
    return !reading.ok() && testing::is_advice(reading.error()) && !device.write({}, {}).ok();
  });
}

TEST(HaplyDevice, ReadsTheHandInOurFrame) {
  FakeHaply service(FakeHaply::state(0.01, -0.12, 0.17));
  const auto device = open(service);
  EXPECT_EQ(device->description(), "Haply Inverse3 049D");
  auto reading = device->read();
  ASSERT_TRUE(reading.ok());
  EXPECT_NEAR(length(reading->position_m - Vec3d{0.01, 0.02, 0}), 0, 1e-9);
  EXPECT_NEAR(length(reading->velocity_m_s - Vec3d{0.1, 0.3, -0.2}), 0, 1e-9);
  EXPECT_EQ(reading->buttons, 0b101u);
  // Half a turn about the service's z, which is our y.
  EXPECT_NEAR(length(rotate(reading->orientation, {0, 0, 1}) - Vec3f{0, 0, -1}), 0, 1e-6f);
  EXPECT_GT(reading->time_us, 0u);
  EXPECT_TRUE(eventually([&] { return device->read()->time_us > reading->time_us; }));
}

TEST(HaplyDevice, OneMessageForEachStateAndTheForceInItsFrame) {
  FakeHaply service(FakeHaply::state(0, -0.12, 0.15));
  const auto device = open(service);
  ASSERT_TRUE(eventually([&] { return service.message_count() > 0; }));
  ASSERT_TRUE(eventually([&] {
    EXPECT_TRUE(device->write({0.5, 1, -0.25}, {}).ok());
    return service.message_count() > 20 &&
           length(force_in(service.messages().back()) - Vec3d{0.5, 0.25, 1}) < 1e-9;
  }));
  const auto messages = service.messages();
  EXPECT_EQ(force_in(messages[0]), Vec3d{}) << "nothing was written before";
  EXPECT_EQ(nlohmann::json::parse(messages[0])["session"]["configure"]["profile"]["name"],
            "Trocar");
  EXPECT_FALSE(nlohmann::json::parse(messages[1]).contains("session"));
}

TEST(HaplyDevice, NoForceIsTooLargeOrNoNumber) {
  FakeHaply service(FakeHaply::state(0, -0.12, 0.15));
  const auto device = open(service);
  const double limit = device->limits().force_n;
  for (const Vec3d& wild : {Vec3d{1e6, 0, 0}, Vec3d{std::nan(""), 1, 1}}) {
    const int before = service.message_count();
    ASSERT_TRUE(eventually([&] {
      EXPECT_TRUE(device->write(wild, {}).ok());
      return service.message_count() > before + 20;
    }));
  }
  for (const auto& message : service.messages()) ASSERT_LE(length(force_in(message)), limit + 1e-9);
}

TEST(HaplyDevice, AForceThatIsNotRenewedEnds) {
  FakeHaply service(FakeHaply::state(0, -0.12, 0.15));
  const auto device = open(service);
  ASSERT_TRUE(eventually([&] {
    EXPECT_TRUE(device->write({0, 1, 0}, {}).ok());
    return service.message_count() > 0 && force_in(service.messages().back()).z == 1;
  }));
  EXPECT_TRUE(eventually([&] { return force_in(service.messages().back()) == Vec3d{}; }));
}

TEST(HaplyDevice, ClosingEndsWithNoForceAndTheProtocolsClose) {
  FakeHaply service(FakeHaply::state(0, -0.12, 0.15));
  {
    const auto device = open(service);
    ASSERT_TRUE(eventually([&] {
      EXPECT_TRUE(device->write({0, 1, 0}, {}).ok());
      return service.message_count() > 0 && force_in(service.messages().back()).z == 1;
    }));
  }
  EXPECT_TRUE(eventually([&] { return service.was_closed(); }));
  EXPECT_EQ(force_in(service.messages().back()), Vec3d{});
}

TEST(HaplyDevice, ASlowServiceIsNotWaitedFor) {
  const auto state = FakeHaply::state(0, -0.12, 0.15);
  std::atomic<bool> may_answer{false};
  FakeHaply service(state, [&](int, const std::string&) {
    eventually([&] { return may_answer.load(); });
    return std::optional(state);
  });
  const auto device = open(service);
  ASSERT_TRUE(eventually([&] { return service.message_count() == 1; }));
  const auto first = device->read();
  for (int i = 0; i < 1000; ++i) {
    EXPECT_TRUE(device->write({0, 1, 0}, {}).ok());
    EXPECT_EQ(device->read()->time_us, first->time_us);
  }
  EXPECT_EQ(service.message_count(), 1) << "nothing piles up";
  may_answer = true;
  EXPECT_TRUE(eventually([&] { return device->read()->time_us > first->time_us; }));
}

TEST(HaplyDevice, AStuckServiceLeavesTheTimeStanding) {
  const auto state = FakeHaply::state(0, -0.12, 0.15);
  FakeHaply service(state, [&](int number, const std::string&) {
    return number < 5 ? std::optional(state) : std::nullopt;
  });
  const auto device = open(service);
  ASSERT_TRUE(eventually([&] { return service.message_count() >= 6; }));
  const auto last = device->read();
  ASSERT_TRUE(last.ok());
  // It is asked again, a second later and no sooner than that, and nothing else changes.
  ASSERT_TRUE(eventually([&] { return service.message_count() >= 7; }));
  EXPECT_EQ(device->read()->time_us, last->time_us);
  EXPECT_TRUE(device->write({0, 1, 0}, {}).ok());
}

TEST(HaplyDevice, AnsweredAgainItGoesOn) {
  const auto state = FakeHaply::state(0, -0.12, 0.15);
  FakeHaply service(state, [&](int number, const std::string&) {
    return number == 3 ? std::nullopt : std::optional(state);
  });
  const auto device = open(service);
  EXPECT_TRUE(eventually([&] { return service.message_count() > 20; }));
}

TEST(HaplyDevice, ADeviceThatIsUnpluggedIsGone) {
  const auto state = FakeHaply::state(0, -0.12, 0.15);
  FakeHaply service(state, [&](int number, const std::string&) {
    return std::optional<std::string>(number < 5 ? state : R"({"inverse3":[]})");
  });
  EXPECT_TRUE(is_gone(*open(service)));
}

TEST(HaplyDevice, AServiceThatEndsIsAnError) {
  const auto state = FakeHaply::state(0, -0.12, 0.15);
  FakeHaply service(state, [&](int number, const std::string&) {
    return std::optional<std::string>(number < 5 ? state : "hang up");
  });
  EXPECT_TRUE(is_gone(*open(service)));
}

TEST(HaplyDevice, AMessageWithoutEndIsRefused) {
  const auto state = FakeHaply::state(0, -0.12, 0.15);
  FakeHaply service(state, [&](int, const std::string&) {
    return std::optional<std::string>(std::string(kHaplyMessageBytes + 1, ' '));
  });
  EXPECT_TRUE(is_gone(*open(service)));
}

TEST(HaplyDevice, GarbageNowAndThenIsLeftOutAndGarbageAlwaysIsAnError) {
  const auto state = FakeHaply::state(0, -0.12, 0.15);
  FakeHaply sometimes(state, [&](int number, const std::string&) {
    const auto far = FakeHaply::state(1e6, 0, 0);
    return std::optional<std::string>(number % 3 == 0 ? "{]" : number % 3 == 1 ? far : state);
  });
  const auto device = open(sometimes);
  ASSERT_TRUE(eventually([&] { return sometimes.message_count() > 100; }));
  const auto reading = device->read();
  ASSERT_TRUE(reading.ok());
  EXPECT_NEAR(length(reading->position_m), 0, 1e-9) << "a kilometre away was left out";
  FakeHaply always(state,
                   [](int, const std::string&) { return std::optional<std::string>("no JSON"); });
  EXPECT_TRUE(is_gone(*open(always)));
}

TEST(HaplyDevice, WhatIsNoSuchServiceIsRefusedWhenOpened) {
  const auto refuses = [](const std::string& inventory) {
    const FakeHaply service(inventory);
    const std::chrono::milliseconds patience(inventory.empty() ? 50 : 30'000);
    const auto opened = HaplyDevice::open(service.url(), patience);
    return !opened.ok() && testing::is_advice(opened.error());
  };
  EXPECT_TRUE(refuses(R"({"inverse3":[]})"));
  EXPECT_TRUE(refuses(R"({"inverse3":{"049D":{"state":{}}}})")) << "version 3.0";
  EXPECT_TRUE(refuses(R"([1,2,3])"));
  EXPECT_TRUE(refuses("\xff\xfe"));
  EXPECT_TRUE(refuses("")) << "nobody answers";
}

TEST(HaplyDevice, WithoutAServiceTheErrorSaysWhatToStart) {
  std::string url;
  {
    const FakeHaply gone("{}");
    url = gone.url();
  }
  for (const std::string& where : {url, std::string("ws://no.such.host.invalid:1"),
                                   std::string("http://localhost"), std::string("ws://:1")}) {
    const auto opened = HaplyDevice::open(where);
    ASSERT_FALSE(opened.ok());
    EXPECT_TRUE(testing::is_advice(opened.error())) << opened.error().message;
  }
}

TEST(HaplyMessages, MalformedStatesAreRefusedAndNoneIsTrusted) {
  const auto with = [](const std::string& member) {
    return R"({"inverse3":[{"device_id":"A","state":{"cursor_velocity":{"x":0,"y":0,"z":0},)" +
           member + "}}]}";
  };
  EXPECT_TRUE(read_haply_state(with(R"("cursor_position":{"x":0,"y":0,"z":0})"), "").ok());
  for (const char* member :
       {R"("cursor_position":{"x":0,"y":0})", R"("cursor_position":{"x":0,"y":0,"z":"0"})",
        R"("cursor_position":[0,0,0])", R"("cursor_position":null)", R"("x":0)",
        R"("cursor_position":{"x":1e999,"y":0,"z":0})",
        R"("cursor_position":{"x":NaN,"y":0,"z":0})"})
    EXPECT_FALSE(read_haply_state(with(member), "").ok()) << member;
  for (const char* text :
       {"", "{", "null", "7", R"({"inverse3":7})", R"({"inverse3":[{"device_id":"A"}]})"})
    EXPECT_FALSE(read_haply_state(text, "").ok()) << text;
  for (const char* text :
       {"{}", R"({"inverse3":[]})", R"({"inverse3":[7]})", R"({"inverse3":[{"device_id":7}]})",
        "{\"inverse3\":[{\"device_id\":\"\\u001b[2J\"}]}"})
    EXPECT_TRUE(read_haply_state(text, "").value().device_id.empty()) << text;
  EXPECT_FALSE(read_haply_state(std::string(200'000, '['), "").ok());
  // Cut at every length.
  const std::string whole = FakeHaply::state(0, 0, 0);
  for (std::size_t n = 0; n < whole.size(); ++n)
    EXPECT_FALSE(read_haply_state(whole.substr(0, n), "").ok());
  EXPECT_TRUE(read_haply_state(whole, "").ok());
  EXPECT_TRUE(read_haply_state(whole, "B")->device_id.empty()) << "another device";
}

TEST(HaplyMessages, AddressesAreParsed) {
  EXPECT_EQ(parse_haply_address("ws://localhost:10001")->port, "10001");
  EXPECT_EQ(parse_haply_address("ws://haptics/")->host, "haptics");
  EXPECT_EQ(parse_haply_address("ws://haptics")->port, "10001");
  for (const char* text : {"", "ws://", "ws://h:", "ws://h:x", "ws://h:123456", "wss://h:1", "h:1"})
    EXPECT_FALSE(parse_haply_address(text).has_value()) << text;
}

}  // namespace
}  // namespace trocar::device
