// A session that bleeds, as processes: everybody has the same blood, the recording is verified, and
// a hand with the suction leaves less of it on the organ.

#include <gtest/gtest.h>

#include "tests/e2e/programs.h"

namespace trocar::e2e {
namespace {

TEST(BleedingSession, EverybodyHasTheSameBloodAndTheRecordingIsVerified) {
  Session session("liver", at_pace(3, {"--bleeding", "--seconds", "10"}));
  auto scalpel = session.hand("Scalpel", kScenes / "incise.toml");
  auto suction = session.hand("Suction", kScenes / "suck.toml");
  auto by_stream = session.client("Stream", "observer", {"--no-datagrams"});
  ASSERT_TRUE(session.wait_for_tick(6000));
  auto late = session.client("Late", "observer", {"--corrupt-frame", "30"});
  ASSERT_EQ(session.server().wait(300), 0) << read_text(session.folder / "server.log");
  for (auto* client : {&scalpel, &suction, &by_stream, &late}) EXPECT_EQ(client->wait(20), 0);
  const auto server = read_text(session.folder / "server.json");
  EXPECT_EQ(json_value(server, "all_replicas_equal"), "true") << server;
  EXPECT_GT(json_number(server, "shed_ml"), 1) << server;
  EXPECT_GT(json_number(server, "sucked_ml"), 0) << server;
  Program verify("trocar-journal", {"verify", session.journal}, session.folder / "verify.log");
  EXPECT_EQ(verify.wait(300), 0) << read_text(session.folder / "verify.log");
}

}  // namespace
}  // namespace trocar::e2e
