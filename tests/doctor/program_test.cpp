// trocar-doctor with a real server: what it finds on good and bad networks, and in what it fails.

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tests/e2e/programs.h"

namespace trocar::e2e {
namespace {

namespace fs = std::filesystem;

class Doctor : public ::testing::Test {
 protected:
  Doctor() { fs::create_directories(folder_); }
  ~Doctor() override { fs::remove_all(folder_); }

  Program start_server() {
    Program server("trocar-server",
                   {"--organ", "lattice", "--journal", "none", "--listen", "127.0.0.1:0", "--state",
                    (folder_ / "state").string(), "--ready-file", (folder_ / "ready").string()},
                   folder_ / "server.log");
    EXPECT_TRUE(wait_until(
        [&] { return read_text(folder_ / "server.log").find("observer ") != std::string::npos; },
        60));
    return server;
  }
  std::string server() const { return ready_address(folder_ / "ready"); }
  std::string code() const { return find_invitation(folder_ / "server.log", "observer").code; }
  // Returns what it writes, with its exit code as "code".
  nlohmann::json ask(std::vector<std::string> arguments) {
    arguments.emplace_back("--json");
    Program doctor("trocar-doctor", arguments, folder_ / "doctor.json");
    const int code = doctor.wait(120);
    auto json = nlohmann::json::parse(read_text(folder_ / "doctor.json"), nullptr, false);
    EXPECT_FALSE(json.is_discarded()) << read_text(folder_ / "doctor.json");
    if (json.is_object()) json["code"] = code;
    return json;
  }
  static std::string grade_of(const nlohmann::json& json, const std::string& subject) {
    for (const auto& finding : json.at("findings"))
      if (finding.at("subject") == subject) return finding.at("grade");
    return "none";
  }

  fs::path folder_ = test_folder();
};

TEST_F(Doctor, AServerOnThisMachineIsMeasuredAndLeftAgain) {
  const auto server_program = start_server();
  const auto json = ask({server(), "--join", code(), "--seconds", "3"});
  EXPECT_LE(json.at("code"), 1) << json;
  EXPECT_EQ(grade_of(json, "server"), "good");
  const auto& visit = json.at("visit");
  EXPECT_EQ(visit.at("joined"), true);
  EXPECT_EQ(visit.at("datagrams"), true);
  EXPECT_GT(visit.at("frame_bytes"), 0);
  EXPECT_GT(visit.at("round_trip_median_ms"), 0);
  EXPECT_TRUE(wait_until(
      [&] {
        return read_text(folder_ / "server.log").find("(observer) left") != std::string::npos;
      },
      20));
}

TEST_F(Doctor, DelayAndLossAreFound) {
  const auto server_program = start_server();
  const Program network("trocar-impair",
                        {"--to", server(), "--listen", "127.0.0.1:0", "--delay", "40",
                         "--down-loss", "10", "--ready-file", (folder_ / "network").string()},
                        folder_ / "network.log");
  ASSERT_TRUE(wait_for_file(folder_ / "network", 20));
  const auto json = ask({ready_address(folder_ / "network"), "--join", code(), "--seconds", "8"});
  EXPECT_EQ(json.at("code"), 1) << json;
  const auto& visit = json.at("visit");
  EXPECT_GE(visit.at("round_trip_median_ms"), 80);  // 40 ms there, 40 ms back
  // Hundreds of datagrams, of which each is lost with 10 %: 6 % is four deviations away from it.
  EXPECT_NEAR(visit.at("lost_percent"), 10, 6);
  EXPECT_EQ(grade_of(json, "loss"), "limited");
  EXPECT_GE(visit.at("clock_error_ms"), 40);
  EXPECT_GE(visit.at("picture_age_ms"), 40);
}

TEST_F(Doctor, DatagramsThatAreBlockedAreALimit) {
  const auto server_program = start_server();
  const Program network("trocar-impair",
                        {"--to", server(), "--listen", "127.0.0.1:0", "--block-datagrams",
                         "--ready-file", (folder_ / "network").string()},
                        folder_ / "network.log");
  ASSERT_TRUE(wait_for_file(folder_ / "network", 20));
  const auto json = ask({ready_address(folder_ / "network"), "--join", code(), "--seconds", "2"});
  EXPECT_EQ(json.at("code"), 1) << json;
  EXPECT_EQ(json.at("visit").at("datagrams"), false);
  EXPECT_EQ(grade_of(json, "loss"), "limited");
}

TEST_F(Doctor, ARefusedCodeIsTold) {
  const auto server_program = start_server();
  auto wrong = code();
  wrong.back() = wrong.back() == '0' ? '1' : '0';
  const auto json = ask({server(), "--join", wrong});
  EXPECT_EQ(json.at("code"), 2) << json;
  EXPECT_EQ(json.at("visit").at("reached"), true);
  EXPECT_EQ(json.at("visit").at("joined"), false);
  EXPECT_EQ(grade_of(json, "server"), "impossible");
  EXPECT_NE(json.at("verdict").get<std::string>().find("code"), std::string::npos) << json;
}

TEST_F(Doctor, NoServerIsTold) {
  // Port 1 of this machine: nobody but root could listen there.
  const auto json = ask({"127.0.0.1:1", "--wait", "0.5"});
  EXPECT_EQ(json.at("code"), 2) << json;
  EXPECT_EQ(json.at("visit").at("reached"), false);
  EXPECT_EQ(json.at("visit").at("address"), "127.0.0.1");
  EXPECT_TRUE(json.at("verdict").get<std::string>().starts_with("You cannot take part."));
  const auto nameless = ask({"no-such-name.invalid"});
  EXPECT_EQ(nameless.at("code"), 2);
  EXPECT_EQ(nameless.at("visit").at("address"), "");
}

TEST_F(Doctor, AWrongCommandLineIsRefused) {
  for (const auto& arguments : {std::vector<std::string>{"--seconds", "nan"},
                                {"--join", "short"},
                                {"10.0.0.1", "--insecure-loopback"},
                                {"host:99999", "--join", "7K3M-9QXZ-4T2B-WN8C"}}) {
    Program doctor("trocar-doctor", arguments, folder_ / "log");
    EXPECT_EQ(doctor.wait(60), 2);
    const auto said = read_text(folder_ / "log");
    EXPECT_TRUE(said.starts_with("trocar-doctor: ")) << said;
    EXPECT_EQ(std::ranges::count(said, '\n'), 1) << said;
  }
}

}  // namespace
}  // namespace trocar::e2e
