// The real programs: hands at a server, watchers at its relay.

#include <gtest/gtest.h>

#include <csignal>

#include "tests/e2e/programs.h"

namespace trocar::e2e {
namespace {

namespace fs = std::filesystem;

constexpr const char* kItself = "127.0.0.1:17798";

class RelayPrograms : public ::testing::Test {
 protected:
  Program start_relay(const std::string& name, const std::string& to,
                      const std::string& listen = "127.0.0.1:0",
                      const std::vector<std::string>& more = {}) {
    const auto ready = session_.folder / (name + ".port");
    std::error_code ignored;
    fs::remove(ready, ignored);
    std::vector<std::string> arguments{"--to",   to,   "--listen",     listen,
                                       "--name", name, "--ready-file", ready.string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    Program relay("trocar-relay", arguments, session_.folder / (name + ".log"));
    EXPECT_TRUE(wait_for_file(ready, 30)) << read_text(session_.folder / (name + ".log"));
    return relay;
  }
  std::string address_of(const std::string& name) const {
    return ready_address(session_.folder / (name + ".port"));
  }
  Program watch(const std::string& name, const std::string& address) {
    return Program("trocar-client",
                   {"--no-render", "--name", name, "--role", "observer", "--server", address,
                    "--summary", (session_.folder / (name + ".json")).string()},
                   session_.folder / (name + ".log"));
  }
  void expect_the_last_picture(const std::string& name) const {
    const auto summary = session_.summary_of(name);
    EXPECT_EQ(json_number(summary, "crc_mismatches"), 0) << name;
    EXPECT_EQ(json_value(summary, "equal"), "true") << name << summary;
  }

  bool says(const std::string& name, const std::string& text) const {
    const auto log = session_.folder / (name + ".log");
    const bool is_said =
        wait_until([&] { return read_text(log).find(text) != std::string::npos; }, 60);
    EXPECT_TRUE(is_said) << text << " is not in " << read_text(log);
    return is_said;
  }
  void expect_a_good_end(const std::vector<std::string>& watchers) {
    session_.server().signal(SIGTERM);
    ASSERT_EQ(session_.server().wait(30), 0);
    for (const auto& name : watchers) {
      const auto summary = session_.folder / (name + ".json");
      EXPECT_TRUE(wait_for_file(summary, 20)) << read_text(session_.folder / (name + ".log"));
      expect_the_last_picture(name);
    }
  }

  Session session_{"lattice", {"--pace", "10"}};
};

TEST_F(RelayPrograms, watchers_of_a_relay_show_what_the_hands_did) {
  auto relay = start_relay("Relay", session_.address());
  auto ann = watch("Ann", address_of("Relay"));
  auto second = start_relay("Second", address_of("Relay"));  // a relay of a relay
  auto ben = watch("Ben", address_of("Second"));
  auto hand = session_.hand("Sam", kScenes / "slices.toml");
  ASSERT_TRUE(session_.wait_for_tick(4000));
  session_.server().signal(SIGTERM);
  ASSERT_EQ(session_.server().wait(30), 0);
  EXPECT_EQ(hand.wait(20), 0);
  EXPECT_EQ(ann.wait(20), 0) << read_text(session_.folder / "Ann.log");
  EXPECT_EQ(ben.wait(20), 0) << read_text(session_.folder / "Ben.log");
  EXPECT_EQ(relay.wait(20), 0) << read_text(session_.folder / "Relay.log");
  EXPECT_EQ(second.wait(20), 0) << read_text(session_.folder / "Second.log");
  expect_the_last_picture("Ann");
  expect_the_last_picture("Ben");
  const auto server = read_text(session_.folder / "server.json");
  EXPECT_EQ(json_value(server, "all_replicas_equal"), "true") << server;
  EXPECT_EQ(json_number(server, "sessions"), 2) << "a hand and a relay";
}

TEST_F(RelayPrograms, watchers_of_a_killed_relay_come_back_to_the_next_and_no_hand_notices) {
  auto relay = start_relay("Relay", session_.address());
  auto hand = session_.hand("Sam", kScenes / "slices.toml");
  auto ann = watch("Ann", address_of("Relay"));
  ASSERT_TRUE(says("Relay", "watchers here"));
  relay.signal(SIGKILL);
  EXPECT_EQ(relay.wait(10), 128 + SIGKILL);
  auto next = start_relay("Relay", session_.address(), address_of("Relay"));
  ASSERT_TRUE(says("Ann", "back in the session"));
  expect_a_good_end({"Ann"});
  EXPECT_EQ(json_number(session_.summary_of("Ann"), "returns"), 1);
  EXPECT_EQ(hand.wait(20), 0);
  EXPECT_EQ(json_number(session_.summary_of("Sam"), "returns"), 0);
  EXPECT_EQ(next.wait(20), 0);
  EXPECT_EQ(ann.wait(20), 0);
}

TEST_F(RelayPrograms, watchers_of_a_killed_relay_go_to_the_other_one) {
  auto other = start_relay("Other", session_.address());
  auto relay =
      start_relay("Relay", session_.address(), "127.0.0.1:0", {"--also", address_of("Other")});
  auto ann = watch("Ann", address_of("Relay"));
  ASSERT_TRUE(says("Relay", "watchers here"));
  relay.signal(SIGKILL);
  EXPECT_EQ(relay.wait(10), 128 + SIGKILL);
  ASSERT_TRUE(says("Ann", "back in the session"));
  expect_a_good_end({"Ann"});
  EXPECT_EQ(ann.wait(20), 0);
  EXPECT_EQ(other.wait(20), 0);
}

TEST_F(RelayPrograms, an_address_that_says_no_does_not_end_those_who_come_back) {
  auto full = start_relay("Full", session_.address(), "127.0.0.1:0", {"--max-watchers", "1"});
  auto other = start_relay("Other", session_.address(), "127.0.0.1:0",
                           {"--state", (session_.folder / "other-state").string()});
  auto ben = watch("Ben", address_of("Full"));
  ASSERT_TRUE(says("Full", "watchers here"));
  auto relay = start_relay("Relay", session_.address(), "127.0.0.1:0",
                           {"--also", address_of("Other"), "--also", address_of("Full")});
  auto ann = watch("Ann", address_of("Relay"));
  ASSERT_TRUE(says("Relay", "watchers here"));
  relay.signal(SIGKILL);
  EXPECT_EQ(relay.wait(10), 128 + SIGKILL);
  ASSERT_TRUE(says("Ann", "says no"));
  auto next = start_relay("Next", session_.address(), address_of("Relay"));
  ASSERT_TRUE(says("Ann", "back in the session"));
  expect_a_good_end({"Ann", "Ben"});
  EXPECT_EQ(ann.wait(20), 0);
  EXPECT_EQ(ben.wait(20), 0);
}

TEST_F(RelayPrograms, a_relay_does_not_follow_the_addresses_of_a_relay_back_to_itself) {
  auto first = start_relay("First", session_.address(), "127.0.0.1:17797", {"--also", kItself});
  auto second = start_relay("Second", address_of("First"), kItself);
  auto ann = watch("Ann", address_of("Second"));
  ASSERT_TRUE(says("Second", "watchers here"));
  first.signal(SIGKILL);
  EXPECT_EQ(first.wait(10), 128 + SIGKILL);
  ASSERT_TRUE(says("Second", "trying again"));
  auto next = start_relay("Next", session_.address(), "127.0.0.1:17797");
  ASSERT_TRUE(says("Second", "back in the session"));
  expect_a_good_end({"Ann"});
  EXPECT_EQ(ann.wait(20), 0);
  EXPECT_EQ(second.wait(20), 0);
  EXPECT_EQ(next.wait(20), 0);
}

TEST_F(RelayPrograms, a_session_that_goes_on_goes_on_for_the_watchers_of_its_relay) {
  auto relay = start_relay("Relay", session_.address());
  auto hand = session_.hand("Sam", kScenes / "slices.toml");
  auto ann = watch("Ann", address_of("Relay"));
  ASSERT_TRUE(session_.wait_for_tick(3000));
  session_.server().signal(SIGKILL);
  EXPECT_EQ(session_.server().wait(10), 128 + SIGKILL);
  Program server("trocar-server",
                 {"--resume", session_.journal.string(), "--listen", session_.address(), "--pace",
                  "10", "--journal", (session_.folder / "next.mcap").string(), "--summary",
                  (session_.folder / "server.json").string()},
                 session_.folder / "server.log");
  ASSERT_TRUE(says("Relay", "back in the session"));
  ASSERT_TRUE(says("Sam", "back in the session"));
  session_.journal = session_.folder / "next.mcap";
  ASSERT_TRUE(session_.wait_for_tick(6000));
  server.signal(SIGTERM);
  EXPECT_EQ(server.wait(30), 0);
  EXPECT_EQ(relay.wait(20), 0) << read_text(session_.folder / "Relay.log");
  EXPECT_EQ(hand.wait(20), 0);
  EXPECT_EQ(ann.wait(20), 0) << read_text(session_.folder / "Ann.log");
  expect_the_last_picture("Ann");
}

TEST_F(RelayPrograms, a_code_of_another_role_is_a_refusal) {
  const auto log = session_.folder / "surgeon.log";
  Program relay("trocar-relay",
                {"--to", find_invitation(session_.folder / "server.log", "surgeon").link,
                 "--listen", "127.0.0.1:0"},
                log);
  EXPECT_EQ(relay.wait(30), 4);
  EXPECT_NE(read_text(log).find("give it the observer's"), std::string::npos) << read_text(log);
}

TEST_F(RelayPrograms, says_for_how_long_it_tries_where_no_server_is_and_ends_in_order_on_sighup) {
  const auto before = std::signal(SIGHUP, SIG_DFL);  // as in a terminal
  Program relay("trocar-relay", {"--to", "127.0.0.1:1", "--code", "0000-0000-0000-0000"},
                session_.folder / "Nobody.log");
  ASSERT_TRUE(says("Nobody", "no server at 127.0.0.1:1 yet"));
  ASSERT_TRUE(says("Nobody", "trying for 15 s"));
  relay.signal(SIGHUP);
  EXPECT_EQ(relay.wait(10), 0) << "a closed terminal";
  std::signal(SIGHUP, before);
}

TEST_F(RelayPrograms, a_wrong_code_is_a_refusal) {
  Program relay("trocar-relay", {"--to", session_.address(), "--code", "0000-0000-0000-0000"},
                session_.folder / "wrong.log");
  EXPECT_EQ(relay.wait(30), 4);
  EXPECT_NE(read_text(session_.folder / "wrong.log").find("is not the server of this join code"),
            std::string::npos);
}

}  // namespace
}  // namespace trocar::e2e
