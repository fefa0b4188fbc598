// The real server under a budget that it cannot keep: what it decided is in the journal, on the
// wire and in the summary, and the journal simulates to the same hashes.

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <thread>

#include "common/journal/session_journal.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/app/server/simulation_loop.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/session/recording/tick_records.h"
#include "server/session/recording/verify.h"
#include "tests/e2e/programs.h"
#include "tests/network/session_fixture.h"

namespace trocar::control {
namespace {

struct Session {
  e2e::Program server;
  std::filesystem::path folder;
  std::uint16_t port = 0;
};

Session start(const std::vector<std::string>& extra) {
  const auto folder = e2e::test_folder();
  std::vector<std::string> arguments{"--insecure-loopback",
                                     "--listen",
                                     "127.0.0.1:0",
                                     "--organ",
                                     "lattice",
                                     "--seconds",
                                     "2",
                                     "--journal",
                                     (folder / "session.mcap").string(),
                                     "--ready-file",
                                     (folder / "port").string(),
                                     "--summary",
                                     (folder / "server.json").string()};
  arguments.insert(arguments.end(), extra.begin(), extra.end());
  e2e::Program server("trocar-server", arguments, folder / "server.log");
  EXPECT_TRUE(e2e::wait_for_file(folder / "port", 60)) << e2e::read_text(folder / "server.log");
  const auto port = std::stoi(e2e::read_text(folder / "port"));
  return {std::move(server), folder, static_cast<std::uint16_t>(port)};
}

// Presses into the top of the block until the server says goodbye; the last rate it was told.
proto::RateState press(std::uint16_t port) {
  testing::RawClient client(port);
  EXPECT_TRUE(client.join("Anna", proto::ROLE_SURGEON));
  proto::RateState last;
  std::uint32_t sequence = 0;
  while (const auto message = client.receive()) {
    if (message->has_goodbye()) break;
    if (!message->has_frame_state()) continue;
    last = message->frame_state().rate();
    auto sample = testing::make_sample(++sequence);
    auto& tool = *sample.mutable_tool_sample();
    tool.mutable_position_m()->set_x(0.005f);
    tool.mutable_position_m()->set_y(0.066f);
    tool.mutable_position_m()->set_z(0.005f);
    tool.mutable_orientation()->set_x(-0.70710678f);  // the shaft's +z turned to +y
    tool.mutable_orientation()->set_y(0);
    tool.mutable_orientation()->set_z(0);
    tool.mutable_orientation()->set_w(0.70710678f);
    if (!client.send(sample)) break;
  }
  return last;
}

// Decisions that differ from those before, with their first tick.
std::vector<std::pair<Tick, step::TickDecisions>> changes_in(const std::filesystem::path& file) {
  std::vector<std::pair<Tick, step::TickDecisions>> changes;
  auto journal = journal::SessionJournal::open(file.string());
  if (!journal.ok()) return changes;
  step::TickRecord record;
  const auto read = (*journal)->read_tick_records(
      0, (*journal)->info().last_tick, [&](Tick tick, const proto::TickRecord& message) {
        EXPECT_TRUE(recording::from_message(message, record).ok());
        if (changes.empty() || changes.back().second != record.decisions) {
          EXPECT_TRUE(message.has_decisions()) << tick;
          changes.emplace_back(message.tick(), record.decisions);
        }
        return true;
      });
  EXPECT_TRUE(read.ok());
  return changes;
}

// The most that a session of the lattice decides.
step::TickDecisions most_for_lattice() {
  const step::Simulation simulation(*catalogue::load_organ("lattice"));
  return simulation.with_sweeps_for_organ({});
}

void expect_verifies(const std::filesystem::path& file) {
  const auto verified = recording::verify_journal(file.string());
  ASSERT_TRUE(verified.ok()) << verified.error().message;
  EXPECT_TRUE(verified->is_resimulated);
  EXPECT_EQ(verified->verdict(), recording::Verdict::Verified) << verified->why();
  EXPECT_EQ(verified->ticks_verified, 2000u);
  EXPECT_EQ(verified->ticks_missing, 0u);
}

TEST(ControlledSession, WhatWasDecidedIsRecordedShownAndSimulatesAgain) {
  auto session = start({"--budget", "0.05"});
  const auto rate = press(session.port);
  ASSERT_EQ(session.server.wait(120), 0) << e2e::read_text(session.folder / "server.log");

  EXPECT_EQ(rate.level(), proto::RATE_OVERLOADED);
  ASSERT_EQ(rate.layer_sweeps_size(), 4);
  EXPECT_EQ(rate.layer_sweeps(0), 2u);
  EXPECT_LE(rate.layer_sweeps(3), 2u);
  EXPECT_GT(rate.lowered(), 0u);
  EXPECT_GT(rate.predicted_us(), rate.budget_us());

  const auto changes = changes_in(session.folder / "session.mcap");
  ASSERT_GE(changes.size(), 2u);
  EXPECT_EQ(changes.front().second, most_for_lattice());
  EXPECT_EQ(changes.back().second.sweeps, 2u);
  expect_verifies(session.folder / "session.mcap");

  const auto summary = e2e::read_text(session.folder / "server.json");
  EXPECT_GT(e2e::json_number(summary, "overloaded"), 0) << summary;
  EXPECT_EQ(e2e::json_number(summary, "fixed"), 0);
  EXPECT_GT(e2e::json_number(summary, "contact_ticks"), 0);
}

// The loop with a clock of its own, on which ticks take far too long for a while and then nothing:
// every step down and up is in the journal.
TEST(ControlledSession, EveryStepDownAndUpIsRecordedAndSimulatesAgain) {
  const auto file = e2e::test_folder() / "steps.mcap";
  const auto organ = *catalogue::make_liver(1500);
  step::Simulation simulation(organ);
  Vec3f top;
  for (const auto node : simulation.state().world.surface_nodes)
    if (simulation.state().world.rest_positions[node.value].y > top.y)
      top = simulation.state().world.rest_positions[node.value];
  auto journal = app::open_journal(file.string(), organ, simulation.layout());
  ASSERT_TRUE(journal.ok());
  participants::SimulationInbox inbox;
  app::FrameHandover handover([] {});
  std::uint64_t now_ns = 0, calls = 0;
  const auto clock_ns = [&] {
    const auto tick = calls++ / 2 + 1;
    return now_ns += tick >= 300 && tick < 700 ? 3'000'000 : 50'000;
  };
  app::SimulationLoop loop(simulation, inbox, handover, journal->get(),
                           {.rate = RateLimits{}, .tick_count = 2000, .clock_ns = clock_ns}, [] {});
  ASSERT_TRUE(inbox.try_push_join({{0}, 1, {}}));
  (*journal)->record_participants({{{0}, "Ada", wire::Role::Surgeon, {tool::ToolShape{}}}}, 0);
  for (bool is_last = false; !is_last;) {
    hands::ToolInput input{{0}, {}};
    input.sample.world_from_tool = {top - Vec3f{0, 0.004f, 0}, rotation_from_z({0, 1, 0})};
    input.sample.verb = tool::Verb::Push;
    inbox.push_sample(input);
    is_last = loop.run_tick();
  }
  ASSERT_TRUE((*journal)->close().ok());
  EXPECT_GT(loop.report().rate.contact_ticks, 1900u);

  const auto changes = changes_in(file);
  int down = 0, up = 0;
  for (std::size_t i = 1; i < changes.size(); ++i) {
    const auto before = step::sweeps_of_layers(changes[i - 1].second),
               now = step::sweeps_of_layers(changes[i].second);
    (now < before || changes[i].second.node_limit < changes[i - 1].second.node_limit ? down : up)++;
  }
  EXPECT_GE(down, 11);
  EXPECT_GE(up, 11);
  EXPECT_EQ(changes.back().second, step::TickDecisions{});
  expect_verifies(file);
}

TEST(RecordedDecisions, OfABrokenJournalAreRefusedByName) {
  const auto read = [](std::initializer_list<std::uint32_t> layers) {
    proto::TickRecord message;
    message.set_tick(7);
    auto& decisions = *message.mutable_decisions();
    decisions.set_depth_limit(3);
    decisions.set_node_limit(100);
    decisions.set_sweeps(4);
    decisions.set_over_relaxation(1.5f);
    for (const auto sweeps : layers) decisions.add_layer_sweeps(sweeps);
    step::TickRecord record;
    const auto status = recording::from_message(message, record);
    return status.ok() ? std::string() : status.error().message;
  };
  EXPECT_EQ(read({}), "");
  EXPECT_EQ(read({3, 2}), "");
  EXPECT_NE(read({3, 2, 1, 1}).find("layer_sweeps"), std::string::npos);
  EXPECT_NE(read({5}).find("layer_sweeps"), std::string::npos);
  EXPECT_NE(read({4'000'000'000u}).find("layer_sweeps"), std::string::npos);
}

TEST(ControlledSession, FixedDecisionsStay) {
  auto session = start({"--fixed-decisions", "--budget", "0.05"});
  const auto rate = press(session.port);
  ASSERT_EQ(session.server.wait(120), 0) << e2e::read_text(session.folder / "server.log");
  EXPECT_EQ(rate.level(), proto::RATE_FIXED);
  const auto changes = changes_in(session.folder / "session.mcap");
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes.front().second, most_for_lattice());
  expect_verifies(session.folder / "session.mcap");
  const auto summary = e2e::read_text(session.folder / "server.json");
  EXPECT_EQ(e2e::json_number(summary, "fixed"), 2000);
}

}  // namespace
}  // namespace trocar::control
