#include "client/device/device_list.h"

#include <gtest/gtest.h>

#include <fstream>
#include <optional>

#include "tests/device/device_bench.h"
#include "tests/device/fake_haply.h"

namespace trocar::device {
namespace {

// Names places where nothing is.
DevicePlaces nowhere(const testing::ShortFolder& folder) {
  return {.haply_url = "ws://127.0.0.1:1",
          .spacemouse_socket = folder.file("spnav.sock"),
          .input_folder = folder.file("input"),
          .dhd_libraries = {"libdhd-that-is-not-there.so"},
          .hd_libraries = {"libHD-that-is-not-there.so"}};
}

TEST(DeviceList, ABareComputerHasASimulatedHandAndSaysHowToGetTheOthers) {
  const testing::ShortFolder folder;
  const auto devices = list_devices(nowhere(folder));
  ASSERT_EQ(devices.size(), 7u);
  for (const auto& device : devices) {
    EXPECT_EQ(device.is_found, device.name == "simulated" || device.name == "journal")
        << device.name;
    EXPECT_NE(device.text.find(", "), std::string::npos) << device.text;
    EXPECT_EQ(device.text.find('\n'), std::string::npos) << device.text;
  }
  const auto table = device_table(devices);
  EXPECT_EQ(std::ranges::count(table, '\n'), 7);
  EXPECT_NE(table.find("\nhaply           missing  "), std::string::npos) << table;
}

TEST(DeviceList, WhatIsThereIsFound) {
  const testing::ShortFolder folder;
  testing::FakeHaply service(testing::FakeHaply::state(0, 0, 0));
  auto places = nowhere(folder);
  places.haply_url = service.url();
  places.dhd_libraries = {FAKE_DHD};
  places.hd_libraries = {FAKE_HD};
  const auto devices = list_devices(places);
  EXPECT_EQ(devices[2].text, "Haply Inverse3 049D");
  for (const int found : {0, 1, 2, 4}) EXPECT_TRUE(devices[found].is_found) << devices[found].name;
}

TEST(DeviceList, EachNameReachesItsBackend) {
  const testing::ShortFolder folder;
  const auto places = nowhere(folder);
  const auto why = [&](const std::string& name) {
    const auto opened = open_device(name, places);
    EXPECT_FALSE(opened.ok()) << name;
    EXPECT_TRUE(testing::is_advice(opened.error())) << opened.error().message;
    return opened.error().message;
  };
  const auto says = [&](const std::string& name, const std::string& text) {
    return why(name).find(text) != std::string::npos;
  };
  EXPECT_TRUE(says("haply", "127.0.0.1:1"));
  EXPECT_TRUE(says("haply:ws://127.0.0.1:2", "127.0.0.1:2"));
  EXPECT_TRUE(says("haply:elsewhere", "ws://"));
  EXPECT_TRUE(says("forcedimension", "libdhd"));
  EXPECT_TRUE(says("forcedimension:0", "libdhd"));
  EXPECT_TRUE(says("forcedimension:left", "forcedimension:0"));
  EXPECT_TRUE(says("openhaptics:Left Device", "libHD"));
  EXPECT_TRUE(says("spacemouse", "spacenavd"));
  EXPECT_TRUE(says("spacemouse:/nowhere", "/nowhere"));
  EXPECT_TRUE(says("gamepad", "no gamepad"));
  EXPECT_TRUE(says("gamepad:/nowhere", "/nowhere"));
  EXPECT_TRUE(says("simulated:wave", "palpate"));
  EXPECT_TRUE(says("journal", "journal:FILE"));
  EXPECT_TRUE(says("journal:session.mcap,tool=2", "tool=1"));
  for (const char* name : {"", ":", "joystick", "\x1b[2J", "Simulated"})
    EXPECT_TRUE(says(name, "no kind of device")) << name;
}

TEST(DeviceList, ASimulatedHandOpensAndMoves) {
  const testing::ShortFolder folder;
  for (const char* name : {"simulated", "simulated:", "simulated:palpate,1Hz,3mm"}) {
    const auto opened = open_device(name);
    ASSERT_TRUE(opened.ok()) << opened.error().message;
    EXPECT_TRUE((*opened)->read().ok());
    EXPECT_EQ((*opened)->description(), "simulated hand");
  }
  const auto path = folder.file("hand.txt");
  std::ofstream(path) << "0 1 2 3\n";
  const auto opened = open_device("simulated:path=" + path);
  ASSERT_TRUE(opened.ok()) << opened.error().message;
  EXPECT_NEAR((*opened)->read()->position_m.z, 0.003, 1e-5);
}

}  // namespace
}  // namespace trocar::device
