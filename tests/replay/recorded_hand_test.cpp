// One hand of a recording: whose samples and forces are whose, what lies between them, and files
// that do not say.

#include "client/replay/recorded_hand.h"

#include <gtest/gtest.h>

#include "common/journal/session_journal_writer.h"
#include "common/wire/tool_shape.h"
#include "tests/support/files.h"

namespace trocar::replay {
namespace {

using trocar::testing::load_file;
using trocar::testing::save_file;
using trocar::testing::TemporaryFolder;

constexpr std::uint64_t kStart = 1'732'200'000'000'000'000;

class RecordedHands : public ::testing::Test {
 protected:
  // Anna has slot 0 and two tools; Ben slot 1; a watcher watches. Anna leaves at 320, and Carl gets
  // her slot at 480. A sample of each tool every 8 ticks, a force every 16.
  void record(const std::function<void(proto::TickRecord&)>& tamper = {}) {
    journal::SessionDescription session;
    session.start_utc_ns = kStart;
    session.organ_name = "blob";
    auto created = journal::SessionJournalWriter::create(path_, session);
    ASSERT_TRUE(created.ok()) << created.error().message;
    auto& writer = **created;
    const auto now = [](Tick tick) { return kStart + tick * kTickNanoseconds; };
    for (Tick tick = 0; tick <= 640; tick += 16) {
      if (tick == 0) write_people(writer, tick, "Anna");
      if (tick == 320) write_people(writer, tick, "");
      if (tick == 480) write_people(writer, tick, "Carl");
      proto::TickBatch batch;
      for (Tick at = tick > 16 ? tick - 15 : 0; at <= tick; ++at) {
        if (at % 8 != 0) continue;
        auto& record = *batch.add_record();
        record.set_tick(at);
        for (std::uint32_t tool : {0u, 1u, 2u}) {
          if (tool < 2 && at >= 320 && at < 480) continue;
          auto& sample = *record.add_sample();
          sample.set_tool(tool);
          sample.mutable_position_m()->set_x(0.1f * static_cast<float>(tool) +
                                             1e-4f * static_cast<float>(at));
          sample.mutable_position_m();
          sample.mutable_orientation()->set_w(1);
          sample.set_verb(at < 160 ? proto::VERB_PUSH : proto::VERB_GRASP);
        }
        if (tamper) tamper(record);
      }
      ASSERT_TRUE(writer.write_tick_batch(tick, now(tick), batch).ok());
      proto::FrameState state;
      state.set_tick(tick);
      for (std::uint32_t tool : {0u, 1u, 2u}) {
        auto& one = *state.add_tool();
        one.set_tool(tool);
        one.mutable_force_n()->set_y(static_cast<float>(tool) + 1e-3f * static_cast<float>(tick));
      }
      ASSERT_TRUE(writer.write(journal::JournalTopic::FrameState, tick, now(tick), state).ok());
    }
    ASSERT_TRUE(writer.close().ok());
  }
  static void write_people(journal::SessionJournalWriter& writer, Tick tick,
                           const std::string& first) {
    proto::Participants list;
    const auto add = [&](const std::string& name, std::uint32_t slot, float radius_m) {
      if (name.empty()) return;
      auto& one = *list.add_participant();
      one.set_name(name);
      one.set_slot(slot);
      for (int i = 0; i < 2 && slot < kMaxHands; ++i)
        wire::write(tool::ToolShape{.radius_m = radius_m}, *one.add_tool());
    };
    add(first, 0, 0.003f);
    add("Ben", 1, 0.004f);
    add("Watcher", kMaxHands, 0);
    ASSERT_TRUE(writer.write_participants(tick, kStart + tick * kTickNanoseconds, list).ok());
  }
  std::string why(const std::string& name, std::size_t tool = 0) {
    const auto hand = read_recorded_hand(path_, name, tool);
    EXPECT_FALSE(hand.ok());
    if (hand.ok()) return {};
    EXPECT_EQ(hand.error().message.find('\n'), std::string::npos);
    return hand.error().message;
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.file("session.mcap");
};

TEST_F(RecordedHands, AreToldApartByNameToolAndTime) {
  record();
  const auto anna = read_recorded_hand(path_, "Anna", 1);
  ASSERT_TRUE(anna.ok()) << anna.error().message;
  EXPECT_EQ(anna->shape.radius_m, 0.003f);
  ASSERT_EQ(anna->samples.size(), 40u) << "until she left";
  EXPECT_FLOAT_EQ(anna->samples[1].world_from_tool.position.x, 0.1008f);
  EXPECT_EQ(anna->felt.size(), 20u);
  EXPECT_FLOAT_EQ(anna->felt[1].force_n.y, 1.016f);
  const auto carl = read_recorded_hand(path_, "Carl", 0);
  ASSERT_TRUE(carl.ok()) << carl.error().message;
  EXPECT_EQ(carl->samples.front().tick, 480u);
  EXPECT_EQ(carl->samples.size(), 21u);
  const auto ben = read_recorded_hand(path_, "Ben", 0);
  ASSERT_TRUE(ben.ok()) << ben.error().message;
  EXPECT_EQ(ben->shape.radius_m, 0.004f);
  EXPECT_FLOAT_EQ(ben->samples.front().world_from_tool.position.x, 0.2f);
  EXPECT_EQ(ben->samples.size(), 81u);
}

TEST_F(RecordedHands, BetweenSamplesTheHandMovesEvenly) {
  record();
  const auto hand = read_recorded_hand(path_, "Ben", 0);
  ASSERT_TRUE(hand.ok());
  EXPECT_FLOAT_EQ(hand->sample_at(12).world_from_tool.position.x, 0.2012f);
  EXPECT_EQ(hand->sample_at(159.9).verb, tool::Verb::Push);
  EXPECT_EQ(hand->sample_at(160).verb, tool::Verb::Grasp);
  EXPECT_FLOAT_EQ(hand->sample_at(-5).world_from_tool.position.x, 0.2f);
  EXPECT_FLOAT_EQ(hand->sample_at(1e6).world_from_tool.position.x, 0.264f);
  EXPECT_NEAR(hand->felt_at(24).force_n.y, 2.024, 1e-6);
  EXPECT_FALSE(hand->felt_at(-1).is_felt);
  EXPECT_FALSE(hand->felt_at(641).is_felt);
  EXPECT_TRUE(hand->felt_at(640).is_felt);
  EXPECT_FALSE(read_recorded_hand(path_, "Anna", 0)->felt_at(400).is_felt) << "she was away";
}

TEST_F(RecordedHands, WhoIsNotThereIsSaid) {
  record();
  EXPECT_NE(why("Mira").find("has no Mira, choose one of: Anna, Ben, Carl"), std::string::npos)
      << why("Mira");
  EXPECT_NE(why("").find("3 participants had tools, choose one of: Anna, Ben, Carl"),
            std::string::npos);
  EXPECT_NE(why("Ben", 1).find("Ben did nothing with tool 1"), std::string::npos);
  EXPECT_NE(why("Watcher").find("has no Watcher"), std::string::npos) << "he had no tools";
}

TEST_F(RecordedHands, WhatIsNoRecordingOrDamagedIsSaid) {
  EXPECT_NE(why("Anna").find(path_), std::string::npos) << "no file";
  record();
  const auto whole = load_file(path_);
  const auto hand = read_recorded_hand(path_, "Anna", 0);
  ASSERT_TRUE(hand.ok());
  // Damage anywhere is said, or does not matter.
  int said = 0;
  constexpr std::size_t kPlaces = 100;
  for (std::size_t place = 0; place < kPlaces; ++place) {
    auto bytes = whole;
    for (std::size_t i = 0; i < 16; ++i) bytes[(bytes.size() - 16) * place / kPlaces + i] ^= 0x5a;
    save_file(path_, bytes);
    const auto damaged = read_recorded_hand(path_, "Anna", 0);
    if (damaged.ok()) {
      EXPECT_EQ(damaged->samples.size(), hand->samples.size()) << place;
      continue;
    }
    ++said;
    EXPECT_NE(damaged.error().message.find(path_), std::string::npos) << damaged.error().message;
    EXPECT_EQ(damaged.error().message.find('\n'), std::string::npos);
  }
  EXPECT_GT(said, 10);
}

TEST_F(RecordedHands, ASampleThatIsNoPlaceIsRefused) {
  int count = 0;
  record([&](proto::TickRecord& record) {
    if (++count == 10) record.mutable_sample(0)->mutable_position_m()->set_y(NAN);
  });
  EXPECT_NE(why("Anna").find("no pose of a tool"), std::string::npos) << why("Anna");
}

TEST(HandInFile, IsParsed) {
  const auto all = parse_hand_in_file("a/b.mcap,name=Anna B,tool=1");
  ASSERT_TRUE(all.ok());
  EXPECT_EQ(all->path, "a/b.mcap");
  EXPECT_EQ(all->name, "Anna B");
  EXPECT_EQ(all->tool, 1u);
  const auto other = parse_hand_in_file("b.mcap,tool=0,name=Ben");
  ASSERT_TRUE(other.ok());
  EXPECT_EQ(other->path, "b.mcap");
  EXPECT_EQ(other->name, "Ben");
  EXPECT_EQ(parse_hand_in_file("b.mcap")->name, "");
  EXPECT_FALSE(parse_hand_in_file("").ok());
  EXPECT_FALSE(parse_hand_in_file("b.mcap,tool=2").ok());
  EXPECT_FALSE(parse_hand_in_file("b.mcap,tool=").ok());
  EXPECT_EQ(parse_hand_name("Anna,tool=1")->tool, 1u);
  EXPECT_EQ(parse_hand_name("Anna,tool=1")->name, "Anna");
  EXPECT_FALSE(parse_hand_name("Anna,tool=x").ok());
}

}  // namespace
}  // namespace trocar::replay
