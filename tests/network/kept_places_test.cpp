// The private file with which people come back to a server that goes on with a recording, and a
// session that begins with such people.

#include "server/app/server/kept_places.h"

#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

#include "tests/network/session_fixture.h"
#include "tests/support/files.h"

namespace trocar::testing {
namespace {

participants::ReturnToken token_of(std::uint8_t byte) {
  participants::ReturnToken token;
  token.fill(byte);
  return token;
}

TEST(KeptPlaces, are_read_as_they_were_written_and_private) {
  const TemporaryFolder folder;
  const auto file = app::places_file(folder.file(""), 7690);
  EXPECT_EQ(file.filename(), "places-7690.json");
  auto none = app::read_places(file);
  ASSERT_TRUE(none.ok());
  EXPECT_TRUE(none->empty());
  const std::vector<app::KeptPlace> places{{{0}, "Anna", token_of(7)},
                                           {{17}, "\u00d6z", token_of(9)}};
  ASSERT_TRUE(app::write_places(file, places).ok());
  struct stat status {};
  ASSERT_EQ(::stat(file.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777u, 0600u);
  const auto read = app::read_places(file);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(*read, places);
  for (const char* bad : {"", "{}", "[1]", R"({"version": 2, "places": []})",
                          R"({"version": 1, "places": [{"slot": 0, "name": "A", "token": "00"}]})",
                          R"({"version": 1, "places": [{"slot": 200, "name": "A", "token":
                              "00112233445566778899aabbccddeeff"}]})"}) {
    std::ofstream(file) << bad;
    EXPECT_FALSE(app::read_places(file).ok()) << bad;
  }
}

TEST(RestoredPlaces, are_kept_for_those_who_were_there_and_given_up_after_the_time) {
  std::atomic<std::uint64_t> clock_ns{1'000'000'000'000};
  replication::ReplicatorOptions options;
  options.clock_ns = [&clock_ns] { return clock_ns.load(); };
  LiveSession session({}, options);
  session.publish(10);
  const auto restore = [&](std::uint8_t slot, const std::string& name) {
    return session.on_io([&] {
      return session.replicator().restore({.slot = {slot},
                                           .name = name,
                                           .role = participants::Role::Surgeon,
                                           .tools = {tool::ToolShape{}}},
                                          token_of(slot));
    });
  };
  EXPECT_TRUE(restore(3, "Anna"));
  EXPECT_TRUE(restore(5, "Ben"));
  EXPECT_FALSE(restore(6, "Ben")) << "a name is there once";
  const auto token = token_of(3);
  RawClient anna(session.port());
  const auto welcome =
      anna.join_to_return("Anna", proto::ROLE_SURGEON, {token.begin(), token.end()});
  ASSERT_TRUE(welcome);
  EXPECT_EQ(welcome->participant(), 3u);
  clock_ns += 31'000'000'000;
  session.publish(10);
  hands::TickInputs inputs;
  session.inbox.drain(inputs);
  EXPECT_TRUE(inputs.joins.empty()) << "the simulation has these hands";
  ASSERT_EQ(inputs.leaves.size(), 1u);
  EXPECT_EQ(inputs.leaves[0].value, 5u);
}

}  // namespace
}  // namespace trocar::testing
