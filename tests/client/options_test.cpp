#include <gtest/gtest.h>

#include "client/app/client_options.h"
#include "client/app/client_summary.h"
#include "tests/client/synthetic_source.h"

namespace trocar::app {
namespace {

Result<std::optional<ClientOptions>> parse(std::vector<std::string> words) {
  words.insert(words.begin(), "trocar-client");
  std::vector<char*> arguments;
  for (auto& word : words) arguments.push_back(word.data());
  return parse_client_command_line(static_cast<int>(arguments.size()), arguments.data());
}

TEST(ClientOptions, DefaultsAreAWindowAndASurgeonOnThisMachine) {
  const auto options = parse({});
  ASSERT_TRUE(options.ok() && options->has_value());
  EXPECT_EQ((*options)->server, "127.0.0.1:7690");
  EXPECT_EQ((*options)->display, Display::Window);
  EXPECT_EQ((*options)->role, replica::Role::Surgeon);
  EXPECT_FALSE((*options)->name.empty());
  EXPECT_EQ((*options)->wait_s, 15);
  EXPECT_LE((*options)->name.size(), 32u);
}

TEST(ClientOptions, ALinkSaysWhereTheServerIsUnlessAnOptionDoes) {
  const std::string link = "trocar://192.168.1.20:7777/7K3M-9QXZ-4T2B-WN8C";
  EXPECT_EQ((*parse({"--join", link}))->server, "192.168.1.20:7777");
  EXPECT_EQ((*parse({"--join", link, "--server", "localhost:1"}))->server, "localhost:1");
  EXPECT_EQ((*parse({"--join", "7k3m9qxz4t2bwn8c"}))->server, "127.0.0.1:7690");
}

TEST(ClientOptions, OverlaysAndViewAreAsAskedFor) {
  const auto plain = parse({});
  EXPECT_EQ((*plain)->overlays, Overlays{});
  const auto some = parse({"--show", "holds,rate", "--view", "30,-10,1.5"});
  ASSERT_TRUE(some.ok()) << some.error().message;
  EXPECT_EQ((*some)->overlays,
            (Overlays{.regions = false, .holds = true, .arrows = false, .rate = true}));
  EXPECT_EQ((*some)->view.yaw_deg, 30);
  EXPECT_EQ((*some)->view.zoom, 1.5);
  const auto none = parse({"--show", "nothing"});
  ASSERT_TRUE(none.ok()) << none.error().message;
  EXPECT_FALSE((*none)->overlays.regions || (*none)->overlays.arrows);
}

TEST(ClientOptions, EachDeviceHasItsToolAndItsPort) {
  const auto plain = parse({"--device", "haply", "--device", "forcedimension"});
  ASSERT_TRUE(plain.ok()) << plain.error().message;
  EXPECT_EQ((*plain)->tool_of(1).name, "all");
  EXPECT_FALSE((*plain)->port_of(0).has_value());
  const auto one =
      parse({"--device", "a", "--device", "b", "--tool", "hook", "--port", "1,-2,3.5"});
  ASSERT_TRUE(one.ok()) << one.error().message;
  EXPECT_EQ((*one)->tool_of(0).name, "hook");
  EXPECT_EQ((*one)->tool_of(1).name, "hook");
  EXPECT_NEAR((*one)->port_of(1)->z, 0.0035, 1e-12);
  EXPECT_NEAR((*one)->port_of(1)->y, -0.002, 1e-12);
  const auto two = parse({"--device", "a", "--device", "b", "--tool", "hook", "--tool", "probe"});
  ASSERT_TRUE(two.ok()) << two.error().message;
  EXPECT_EQ((*two)->tool_of(0).name, "hook");
  EXPECT_EQ((*two)->tool_of(1).name, "probe");
  const auto mouse = parse({"--tool", "scissors", "--hands", "1"});
  ASSERT_TRUE(mouse.ok()) << mouse.error().message;
  EXPECT_EQ((*mouse)->tool_of(0).name, "scissors");
  EXPECT_EQ((*mouse)->mouse_hands, 1);
}

TEST(ClientOptions, ARecordedHandIsFelt) {
  const auto options =
      parse({"--replay", "x.mcap", "--device", "a", "--device", "b", "--feel", "Anna", "--feel",
             "Anna,tool=1", "--feel-pull", "0", "--hand-trace", "t.csv"});
  ASSERT_TRUE(options.ok()) << options.error().message;
  ASSERT_EQ((*options)->feels.size(), 2u);
  EXPECT_EQ((*options)->feels[1].name, "Anna");
  EXPECT_EQ((*options)->feels[1].tool, 1u);
  EXPECT_EQ((*options)->feel_pull_n_m, 0);
}

TEST(ClientOptions, TwoRecordingsStandBesideEachOther) {
  const auto options =
      parse({"--replay", "x.mcap", "--beside", "y.mcap", "--align", "start", "--own-views"});
  ASSERT_TRUE(options.ok()) << options.error().message;
  EXPECT_EQ((*options)->beside_file, "y.mcap");
  EXPECT_EQ((*options)->align, replay::Alignment::Start);
  EXPECT_TRUE((*options)->has_own_views);
  const auto plain = parse({"--replay", "x.mcap", "--beside", "y.mcap"});
  ASSERT_TRUE(plain.ok()) << plain.error().message;
  EXPECT_FALSE((*plain)->align);
}

TEST(ClientOptions, EachWrongValueIsAUsageErrorThatNamesTheOption) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"--size", "5"}, "--size"},
      {{"--size", "10x10"}, "--size"},
      {{"--size", "640x480x3"}, "--size"},
      {{"--role", "nurse"}, "--role"},
      {{"--fps", "0"}, "--fps"},
      {{"--wait", "-1"}, "--wait"},
      {{"--wait", "nan"}, "--wait"},
      {{"--screenshot-at", "-3"}, "--screenshot-at"},
      {{"--role", "observer", "--script", "x.toml"}, "--script"},
      {{"--replay", "x.mcap", "--script", "x.toml"}, "--replay"},
      {{"--pictures", "out"}, "--replay"},
      {{"--beside", "y.mcap"}, "--replay"},
      {{"--replay", "x.mcap", "--align", "stage"}, "--beside"},
      {{"--replay", "x.mcap", "--own-views"}, "--beside"},
      {{"--replay", "x.mcap", "--beside", "y.mcap", "--align", "end"}, "--align"},
      {{"--replay", "x.mcap", "--beside", "y.mcap", "--pictures", "out"}, "--pictures"},
      {{"--replay", "x.mcap", "--beside", "y.mcap", "--no-render"}, "--no-render"},
      {{"--replay", "x.mcap", "--beside", "y.mcap", "--device", "haply", "--feel", "Anna"},
       "--beside"},
      {{"--replay", "x.mcap", "--pictures", "out", "--rate", "0"}, "--rate"},
      {{"--no-render", "--screenshot", "x.png"}, "--screenshot"},
      {{"--show", "regions,shadows"}, "--show"},
      {{"--show", "nothing,arrows"}, "--show"},
      {{"--scale", "0.5"}, "--scale"},
      {{"--scale", "3.1"}, "--scale"},
      {{"--scale", "large"}, "--scale"},
      {{"--view", "10,20"}, "--view"},
      {{"--view", "10,20,0"}, "--view"},
      {{"--view", "nan,0,1"}, "--view"},
      {{"--join", "7K3M"}, "--join"},
      {{"--join", "trocar://nowhere"}, "--join"},
      {{"--device", "haply", "--device", "haply", "--device", "haply"}, "--device"},
      {{"--device", "haply", "--script", "x.toml"}, "--device"},
      {{"--device", "haply", "--replay", "x.mcap"}, "--feel"},
      {{"--device", "haply", "--feel", "Anna"}, "--replay"},
      {{"--replay", "x.mcap", "--feel", "Anna"}, "--device"},
      {{"--replay", "x.mcap", "--device", "haply", "--feel", "Anna,tool=3"}, "--feel"},
      {{"--replay", "x.mcap", "--device", "haply", "--feel", "Anna", "--tool", "hook"}, "--tool"},
      {{"--device", "haply", "--tool", "spoon"}, "--tool"},
      {{"--device", "haply", "--tool", "hook", "--tool", "probe"}, "--tool"},
      {{"--tool", "spoon"}, "--tool"},
      {{"--tool", "hook", "--tool", "probe"}, "--tool"},
      {{"--script", "x.toml", "--tool", "hook"}, "--tool"},
      {{"--hands", "3"}, "--hands"},
      {{"--device", "haply", "--port", "1,2"}, "--port"},
      {{"--device", "haply", "--port", "1,2,3,4"}, "--port"},
      {{"--device", "haply", "--port", "1,2,nan"}, "--port"},
      {{"--device", "haply", "--port", "1,2,2001"}, "--port"},
      {{"--port", "1,2,3"}, "--port"},
      {{"--hand-trace", "x.csv"}, "--hand-trace"},
      {{"--insecure-loopback", "--join", "7K3M-9QXZ-4T2B-WN8C"}, "--insecure-loopback"},
      {{"--no-such-option"}, "no-such-option"}};
  for (const auto& [words, name] : cases) {
    const auto options = parse(words);
    ASSERT_FALSE(options.ok()) << name;
    EXPECT_EQ(options.error().code, ErrorCode::Usage);
    EXPECT_NE(options.error().message.find(name), std::string::npos) << options.error().message;
    EXPECT_EQ(options.error().message.find('\n'), std::string::npos) << options.error().message;
  }
}

TEST(ClientSummary, IsJsonWithTheReplicasFigures) {
  testing::SyntheticSource source(testing::make_blob_layout(8, 12, 0.08), "a \"blob\"");
  replica::Replica replica([&](const proto::Envelope& message) { return source.send(message); });
  source.queue_start();
  for (int i = 0; i < 40; ++i) source.queue_frame();
  source.poll(replica);
  const std::string json =
      to_json({"Ada", "surgeon", "end of --seconds"}, replica, source.statistics());
  EXPECT_NE(json.find("\"organ\": \"a \\\"blob\\\"\""), std::string::npos) << json;
  EXPECT_NE(json.find("\"final_frame\": 40"), std::string::npos) << json;
  EXPECT_NE(json.find("\"barrier\": null"), std::string::npos) << json;
  char crc[16];
  std::snprintf(crc, sizeof crc, "\"%08x\"", wire::surface_crc(source.surface()));
  EXPECT_NE(json.find(crc), std::string::npos) << json;
}

}  // namespace
}  // namespace trocar::app
