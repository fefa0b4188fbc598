// A bus is refused in one line that shows no password, before anything is sent.

#include "server/bus/bus.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace trocar::bus {
namespace {

// Without NATS in the build, connect() says that instead.
bool is_built_without_nats() {
  const auto bus = Bus::connect({.url = "nats://127.0.0.1:1"}, "test", false);
  return !bus.ok() && bus.error().code == ErrorCode::Usage;
}

std::string refusal_of(const BusPlace& place) {
  const auto bus = Bus::connect(place, "test", true);
  return bus.ok() ? "none" : bus.error().message;
}

TEST(BusPlace, takes_no_password_in_a_url_and_shows_none) {
  for (const char* url : {"nats://ada:secret@127.0.0.1:1", "nats://ada:sec,ret@127.0.0.1:1",
                          "nats://127.0.0.1:1,sec://ret@127.0.0.1:2"}) {
    const auto said = refusal_of({.url = url});
    EXPECT_EQ(said.find("sec"), std::string::npos) << said;
    EXPECT_EQ(said.find("ret"), std::string::npos) << said;
    EXPECT_EQ(said.find("none"), std::string::npos) << said;
  }
}

TEST(BusPlace, needs_tls_for_all_addresses_or_none_and_for_a_certificate) {
  if (is_built_without_nats()) GTEST_SKIP() << "this build has no NATS";
  EXPECT_NE(refusal_of({.url = "tls://127.0.0.1:1,nats://127.0.0.1:2"}).find("others without"),
            std::string::npos);
  EXPECT_NE(refusal_of({.url = "tls://127.0.0.1:1,127.0.0.1:2"}).find("others without"),
            std::string::npos);
  for (const char* url : {"TLS://127.0.0.1:1", "nats://127.0.0.1:1, tls://127.0.0.1:2", "http://a",
                          "foo", "127.0.0.1:4222", "nats://"})
    EXPECT_NE(refusal_of({.url = url}).find("is neither"), std::string::npos) << url;
  EXPECT_NE(refusal_of({.url = "nats://127.0.0.1:1", .ca_file = "ca.pem"}).find("needs --nats tls"),
            std::string::npos);
}

TEST(BusPlace, takes_no_file_that_is_not_there_not_private_or_of_something_else) {
  if (is_built_without_nats()) GTEST_SKIP() << "this build has no NATS";
  namespace fs = std::filesystem;
  const auto file = fs::temp_directory_path() / ("bus_creds_" + std::to_string(::getpid()));
  const BusPlace place{.url = "tls://127.0.0.1:1", .creds_file = file.string()};
  EXPECT_NE(refusal_of(place).find("--nats-creds: "), std::string::npos);
  for (const char* text : {"", "ada", ":secret", "ada:two words", "ada:a\nbob:b"}) {
    std::ofstream(file) << text;
    fs::permissions(file, fs::perms::owner_read | fs::perms::owner_write);
    EXPECT_NE(refusal_of(place).find("holds neither"), std::string::npos) << text;
  }
  std::ofstream(file) << "ada:secret";
  fs::permissions(file, fs::perms::others_read, fs::perm_options::add);
  EXPECT_NE(refusal_of(place).find(file.string()), std::string::npos);
  const BusPlace bad_ca{.url = "tls://127.0.0.1:1", .ca_file = file.string()};
  EXPECT_NE(refusal_of(bad_ca).find("no certificate in PEM"), std::string::npos);
  fs::remove(file);
}

}  // namespace
}  // namespace trocar::bus
