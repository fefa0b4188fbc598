// A shared session, whole: processes, sockets, files. What all of them saw must be the same
// surface, and what was recorded must simulate to the same bits.

#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <map>
#include <random>

#include "client/replay/replay_source.h"
#include "client/replica/replica.h"
#include "common/journal/session_journal.h"
#include "common/wire/surface_codec.h"
#include "server/organs/organ/organ_file.h"
#include "server/session/recording/tick_records.h"
#include "server/session/recording/verify.h"
#include "server/tissue/step/simulation.h"
#include "tests/e2e/programs.h"
#include "tests/support/shared.h"

namespace trocar::e2e {
namespace {

// CRC of the surface at each published tick, from simulating the journal's inputs again.
std::map<Tick, std::uint32_t> simulate_again(const std::filesystem::path& file) {
  std::map<Tick, std::uint32_t> crcs;
  auto journal = journal::SessionJournal::open(file.string());
  EXPECT_TRUE(journal.ok());
  const std::string organ = (*journal)->organ()->SerializeAsString();
  step::Simulation simulation(*organ::decode_organ(bytes_of(std::string_view(organ))));
  step::TickRecord record;
  const auto read = (*journal)->read_tick_records(
      0, (*journal)->info().last_tick, [&](Tick tick, const proto::TickRecord& message) {
        EXPECT_TRUE(recording::from_message(message, record).ok());
        simulation.tick(record.inputs, record.decisions);
        if (auto frame = simulation.pop_frame()) crcs[tick] = frame->surface_crc;
        return true;
      });
  EXPECT_TRUE(read.ok());
  return crcs;
}

void expect_replay_equals(const std::filesystem::path& file,
                          const std::map<Tick, std::uint32_t>& crcs) {
  std::uint64_t now = 1;
  auto source = replay::ReplaySource::open(file.string(), [&now] { return now; });
  ASSERT_TRUE(source.ok()) << source.error().message;
  replica::Replica replica([](const proto::Envelope&) { return true; });
  std::mt19937 random(5);
  (*source)->pause();
  for (int i = 0; i < 5; ++i) {
    auto chosen = crcs.begin();
    std::advance(chosen, static_cast<long>(random() % crcs.size()));
    (*source)->seek(chosen->first);
    for (int poll = 0; poll < 3; ++poll) {
      now += 1'000'000;
      (*source)->poll(replica);
    }
    EXPECT_EQ(replica.surface_crc(), chosen->second) << "at tick " << chosen->first;
  }
}

void run_shared_session(const std::string& organ) {
  Session session(organ, at_pace(3, {"--seconds", "12"}));
  auto lift = session.hand("Lift", kScenes / "lift.toml");
  auto press = session.hand("Press", kScenes / "press.toml");
  auto instructor = session.client("Instructor", "instructor");
  ASSERT_TRUE(session.wait_for_tick(5000));
  auto observer = session.client("Observer", "observer", {"--corrupt-frame", "100"});

  ASSERT_EQ(session.server().wait(300), 0) << read_text(session.folder / "server.log");
  for (auto* client : {&lift, &press, &instructor, &observer}) EXPECT_EQ(client->wait(20), 0);

  const auto server = read_text(session.folder / "server.json");
  EXPECT_EQ(json_value(server, "all_replicas_equal"), "true") << server;
  EXPECT_EQ(json_number(server, "last_tick"), 12'000);
  for (const char* name : {"Lift", "Press", "Instructor", "Observer"}) {
    const auto summary = session.summary_of(name);
    EXPECT_EQ(json_value(summary, "own_crc"), json_value(server, "surface_crc")) << name;
    const bool is_corrupted = std::string(name) == "Observer";
    EXPECT_EQ(json_number(summary, "crc_mismatches"), is_corrupted ? 1 : 0) << name;
    EXPECT_EQ(json_number(summary, "healed"), is_corrupted ? 1 : 0) << name;
  }
  const auto instructed = session.summary_of("Instructor");
  EXPECT_GE(json_number(instructed, "share_moved_over_1_mm"), 0.20);

  const auto verified = recording::verify_journal(session.journal.string());
  ASSERT_TRUE(verified.ok()) << verified.error().message;
  EXPECT_TRUE(verified->is_resimulated);
  EXPECT_EQ(verified->verdict(), recording::Verdict::Verified) << verified->why();
  EXPECT_EQ(verified->ticks_verified, 12'000u);
  EXPECT_EQ(verified->ticks_missing, 0u);
  EXPECT_GE(verified->snapshots_verified, 2u);
  expect_replay_equals(session.journal, simulate_again(session.journal));
  std::printf("share moved over 1 mm %s, %s bytes per changed vertex, tick %s us median\n",
              json_value(instructed, "share_moved_over_1_mm").c_str(),
              json_value(server, "bytes_per_changed_vertex").c_str(),
              json_value(server.substr(server.find("tick_cpu_us")), "median").c_str());
}

TEST(SharedSession, OnTheBuiltInLiverEveryReplicaAndTheJournalAgree) {
  run_shared_session("liver");
}

TEST(SharedSession, OnAnImportedLiverEveryReplicaAndTheJournalAgree) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/liver_coarse.msh");
  // Held at the back, so that its lower edge can be lifted like that of the built-in liver.
  const auto organ = test_folder() / "coarse.organ";
  const auto mesh = testing::shared_folder() / "organs/liver_coarse.msh";
  Program import("trocar-organ",
                 {"import", mesh.string(), "--fix", "back:0.2", "--out", organ.string()},
                 organ.string() + ".log");
  ASSERT_EQ(import.wait(60), 0) << read_text(organ.string() + ".log");
  run_shared_session(organ.string());
}

void expect_verified(const std::filesystem::path& journal, std::uint64_t least_ticks) {
  const auto verified = recording::verify_journal(journal.string());
  ASSERT_TRUE(verified.ok()) << verified.error().message;
  EXPECT_EQ(verified->verdict(), recording::Verdict::Verified) << verified->why();
  EXPECT_GE(verified->ticks_verified, least_ticks);
  expect_replay_equals(journal, simulate_again(journal));
}

// Two blades at two places, an assistant who draws one wound open, somebody who comes in the
// middle, and a watcher whose picture breaks once and heals.
TEST(SharedSession, CutsAreTheSameForEverybodyAndInTheRecording) {
  Session session("liver", at_pace(4, {"--seconds", "9"}));
  auto incise = session.hand("Incise", kScenes / "incise.toml");
  auto retract = session.hand("Retract", kScenes / "retract.toml");
  auto slices = session.hand("Slices", kScenes / "slices.toml");
  auto watcher = session.client("Watcher", "observer", {"--corrupt-frame", "200"});
  ASSERT_TRUE(session.wait_for_tick(4000));
  auto late = session.client("Late", "instructor");

  ASSERT_EQ(session.server().wait(300), 0) << read_text(session.folder / "server.log");
  for (auto* client : {&incise, &retract, &slices, &watcher, &late}) EXPECT_EQ(client->wait(20), 0);
  const auto server = read_text(session.folder / "server.json");
  EXPECT_EQ(json_value(server, "all_replicas_equal"), "true") << server;
  for (const char* name : {"Incise", "Retract", "Slices", "Watcher", "Late"}) {
    const auto summary = session.summary_of(name);
    EXPECT_EQ(json_value(summary, "own_crc"), json_value(server, "surface_crc")) << name;
    EXPECT_EQ(json_number(summary, "change_mismatches"), 0) << name;
    EXPECT_EQ(json_number(summary, "surface_vertices"), json_number(server, "surface_vertices"));
  }
  EXPECT_GT(json_number(session.summary_of("Watcher"), "surface_changes"), 25);
  EXPECT_GT(json_number(server, "surface_vertices"), 1700);

  expect_verified(session.journal, 9'000);
}

// The instructor marks the organ, two hands cut it, and he returns it to the mark.
TEST(SharedSession, AReturnToTheMarkIsTheSameForEverybodyAndInTheRecording) {
  Session session("liver", at_pace(3, {"--seconds", "9"}));
  auto instructor = session.client("Teacher", "instructor", {"--mark-at", "1", "--return-at", "5"});
  auto incise = session.hand("Incise", kScenes / "incise.toml");
  auto watcher = session.client("Watcher", "observer");
  ASSERT_EQ(session.server().wait(300), 0) << read_text(session.folder / "server.log");
  for (auto* client : {&instructor, &incise, &watcher}) EXPECT_EQ(client->wait(20), 0);
  const auto server = read_text(session.folder / "server.json");
  EXPECT_EQ(json_value(server, "all_replicas_equal"), "true") << server;
  for (const char* name : {"Teacher", "Incise", "Watcher"}) {
    const auto summary = session.summary_of(name);
    EXPECT_EQ(json_value(summary, "own_crc"), json_value(server, "surface_crc")) << name;
    EXPECT_EQ(json_number(summary, "marks"), 2) << name;
    EXPECT_EQ(json_number(summary, "change_mismatches"), 0) << name;
    EXPECT_GT(json_number(summary, "surface_changes"), 3) << name;
  }
  expect_verified(session.journal, 9'000);
}

TEST(SharedSession, AKilledServerLosesAtMostHalfASecondOfItsRecording) {
  Session session("liver", {"--return-seconds", "2"});
  auto lift = session.hand("Lift", kScenes / "lift.toml");
  auto observer = session.client("Observer", "observer");
  ASSERT_TRUE(session.wait_for_tick(2500));
  session.server().signal(SIGKILL);
  EXPECT_EQ(session.server().wait(10), 128 + SIGKILL);
  EXPECT_EQ(observer.wait(20), 5) << "the session was lost";
  EXPECT_EQ(lift.wait(20), 5);

  const double last_seen = json_number(session.summary_of("Observer"), "final_tick");
  EXPECT_GT(last_seen, 500);
  const auto verified = recording::verify_journal(session.journal.string());
  ASSERT_TRUE(verified.ok()) << verified.error().message;
  // The server was killed: all that it wrote is equal, and the missing end is said.
  EXPECT_EQ(verified->verdict(), recording::Verdict::NotVerified) << verified->why();
  EXPECT_NE(verified->why().find("it has no end"), std::string::npos) << verified->why();
  EXPECT_GT(verified->ticks_verified, 0u);
  EXPECT_EQ(verified->ticks_missing, 0u);
  const double recovered = static_cast<double>(verified->ticks_verified);
  EXPECT_LE(last_seen - recovered, 500);
  std::printf("last frame seen shows tick %.0f, %.0f ticks recovered\n", last_seen, recovered);
}

TEST(SharedSession, SigtermEndsItInOrder) {
  Session session("liver");
  auto lift = session.hand("Lift", kScenes / "lift.toml");
  ASSERT_TRUE(session.wait_for_tick(1000));
  session.server().signal(SIGTERM);
  EXPECT_EQ(session.server().wait(20), 0);
  EXPECT_EQ(lift.wait(20), 0);
  const auto journal = journal::SessionJournal::open(session.journal.string());
  ASSERT_TRUE(journal.ok());
  EXPECT_TRUE((*journal)->info().is_finished);
  const auto log = read_text(session.folder / "Lift.log");
  EXPECT_NE(log.find("session is over"), std::string::npos) << log;
}

TEST(SharedSession, AnExistingJournalIsNeverOverwritten) {
  const auto folder = test_folder();
  const auto file = folder / "kept.mcap";
  { std::ofstream(file) << "kept"; }
  Program server("trocar-server",
                 {"--organ", "lattice", "--listen", "127.0.0.1:0", "--journal", file.string()},
                 folder / "server.log");
  EXPECT_NE(server.wait(30), 0);
  EXPECT_EQ(read_text(file), "kept");
}

}  // namespace
}  // namespace trocar::e2e
