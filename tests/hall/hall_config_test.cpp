#include "server/hall/plan/hall_config.h"

#include <gtest/gtest.h>

#include <string>

namespace trocar::hall {
namespace {

const std::string kLeast = R"(key = "hall.key"
recordings = "recordings"
[[offer]]
name = "liver"
organ = "liver"
)";

Result<HallConfig> read(const std::string& text) {
  return read_hall_config_text(text, "hall.toml", 4);
}
std::string error_of(const std::string& text) {
  const auto config = read(text);
  return config ? "it was read" : config.error().message;
}

TEST(HallConfig, NeedsLittle) {
  const auto config = read(kLeast);
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(config->address, "127.0.0.1");
  EXPECT_EQ(config->cores, 4) << "those of the machine";
  ASSERT_NE(config->find_offer("liver"), nullptr);
  EXPECT_EQ(config->find_offer("spleen"), nullptr);
}

TEST(HallConfig, TheExampleIsRead) {
  const auto config = read_hall_config(
      std::filesystem::path(TROCAR_SOURCE_DIR) / "deploy/trocar-hall.toml.example", 4);
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(config->port, HallConfig().port) << "it shows the defaults";
  EXPECT_EQ(config->ports.first, HallConfig().ports.first);
  EXPECT_EQ(config->figures_ports.last, HallConfig().figures_ports.last);
  EXPECT_EQ(config->most_sessions, HallConfig().most_sessions);
  EXPECT_EQ(config->restarts, HallConfig().restarts);
}

TEST(HallConfig, ALessonBringsItsOrgan) {
  const auto config = read(kLeast + "[[offer]]\nname = \"rings\"\nlesson = \"move-the-rings\"\n");
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(config->find_offer("rings")->organ, "pegs");
  EXPECT_EQ(config->list_offers(), "liver, rings");
}

TEST(HallConfig, SaysWhereItIsWrong) {
  struct Case {
    std::string text, expected;
  };
  for (const auto& [text, expected] : {
           Case{"", "key key: is missing"},
           {"key = \"k\"\n", "recordings"},
           {"sessions-listen = \"nowhere\"\n" + kLeast, "key sessions-listen: is no IPv4"},
           {"listen = \"nowhere:7694\"\ntls = true\n" + kLeast, "key listen: is not ADDRESS:PORT"},
           {"key = \"k\"\nrecordings = \"r\"\n", "[[offer]]"},
           {"most-sesions = 3\n" + kLeast, "hall.toml:1: key most-sesions: is unknown"},
           {"most-sessions = 0\n" + kLeast, "allowed are 1 to 64"},
           {"most-sessions = 21\n" + kLeast, "there are 20 ports"},
           {"ports = [7700]\n" + kLeast, "no range"},
           {"ports = [80, 90]\n" + kLeast, "no range"},
           {"ports = [7729, 7710]\n" + kLeast, "no range"},
           {"ports = [7720, 7760]\n" + kLeast, "overlaps"},
           {"cores = 0\n" + kLeast, "cores"},
           {"listen = \"7694\"\n" + kLeast, "hall.toml:1: key listen: is not ADDRESS:PORT"},
           {"listen = \"0.0.0.0:7694\"\n" + kLeast, "open-without-tls"},
           {"tls = true\nopen-without-tls = true\n" + kLeast, "open-without-tls: is true and so"},
           {"tls = true\ncertificate = \"a.crt\"\n" + kLeast, "needs certificate-key"},
           {"certificate = \"a\"\ncertificate-key = \"b\"\n" + kLeast, "write tls = true"},
           {kLeast + "cores = 0\n", "allowed are 0.05"},
           {kLeast + "[[offer]]\nname = \"liver\"\norgan = \"liver\"\n", "is there twice"},
           {kLeast + "[[offer]]\nname = \"a\"\n", "either a lesson or an organ"},
           {kLeast + "lesson = \"find-the-lump\"\n", "either a lesson or an organ"},
           {kLeast + "[[offer]]\nname = \"a\"\nlesson = \"no-such\"\n", "no-such"},
           {kLeast + "[[offer]]\nname = \"../a\"\norgan = \"liver\"\n", "is no name"},
           {std::string(70'000, '#'), "hall.toml"},
       })
    EXPECT_NE(error_of(text).find(expected), std::string::npos) << text << error_of(text);
}

TEST(HallConfig, OthersMayReachItIfTheFileSaysSo) {
  const auto config = read("listen = \"0.0.0.0:7694\"\nopen-without-tls = true\n" + kLeast);
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(config->address, "0.0.0.0");
}

TEST(HallConfig, NamesMayBeFolders) {
  for (const auto* good : {"a", "0", "find-the-lump-1", "a23456789012345678901234567890-2"})
    EXPECT_TRUE(is_name(good)) << good;
  for (const auto* bad : {"", ".", "..", "a/b", "-a", "A", "a b", "a_b", "\xc3\xa9", "a\n",
                          "a234567890123456789012345678901-3"})
    EXPECT_FALSE(is_name(bad)) << bad;
}

}  // namespace
}  // namespace trocar::hall
