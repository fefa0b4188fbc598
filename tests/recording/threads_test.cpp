// Recordings of sessions with surgical thread: it is simulated again and compared, to the bit.

#include <gtest/gtest.h>

#include <filesystem>

#include "common/wire/thread_codec.h"
#include "proto/journal.pb.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/session/recording/resume.h"
#include "server/session/recording/thread_messages.h"
#include "server/session/recording/trim.h"
#include "server/session/recording/verify.h"
#include "tests/recording/recorded_simulation.h"
#include "tests/support/files.h"

namespace trocar::recording::testing {
namespace {

using trocar::testing::TemporaryFolder;

// A thread lies where the second hand of the recorded session grasps, and hangs over a peg there.
thread::Rules rules_at_the_hand() {
  Vec3d top{0, -1, 0};
  const auto liver = catalogue::make_liver(800);
  for (const auto& place : liver->mesh.rest_positions)
    if (place.y > top.y) top = place;
  const Vec3d hand = top + Vec3d{0.05, 0.002, 0.02};
  thread::Rules rules;
  rules.threads.push_back(
      {.name = "stitch",
       .material = thread::Material::Polyglactin,
       .size = thread::Size::Usp4_0,
       .path_m = {hand + Vec3d{0, 0, -0.03}, hand + Vec3d{0, 0, 0.03}},
       .self_friction = 0.3,
       .start = {.is_held = true, .velocity_m_s = {0, 0.001, 0}, .load_n = {}, .until_s = 1},
       .end = {.is_held = false, .velocity_m_s = {}, .load_n = {0, -0.01, 0}, .until_s = 0.5}});
  rules.pegs.push_back({.from_m = hand + Vec3d{-0.02, -0.005, 0.02},
                        .to_m = hand + Vec3d{0.02, -0.005, 0.02},
                        .radius_m = 0.002,
                        .friction = 0.1});
  rules.floor_y_m = hand.y - 0.05;
  return rules;
}

class ThreadRecording : public ::testing::Test {
 protected:
  // Simulated once for all tests.
  static const std::string& sound() {
    static const TemporaryFolder folder;
    static const std::string path = [] {
      auto file = folder.file("thread.mcap");
      record_simulation(file, 0, {.threads = rules_at_the_hand()});
      return file;
    }();
    return path;
  }
  VerifyReport verify_copy(const Edit& edit) {
    const auto copy = folder_.file("copy.mcap");
    std::filesystem::remove(copy);
    copy_journal(sound(), copy, edit);
    auto report = verify_journal(copy);
    EXPECT_TRUE(report.ok()) << report.error().message;
    return report.ok() ? std::move(*report) : VerifyReport{};
  }

  TemporaryFolder folder_;
};

TEST_F(ThreadRecording, IsVerifiedWholeAndTheHandMovesTheThread) {
  std::vector<wire::QuantisedVertex> first, last;
  const auto report = verify_copy([&](std::string_view topic, google::protobuf::Message& message) {
    if (topic != "/frame_state") return true;
    const auto& bytes = static_cast<proto::FrameState&>(message).threads();
    const auto picture = wire::decode_threads(bytes_of(std::string_view(bytes)));
    EXPECT_TRUE(picture.ok());
    last = picture->places;
    if (first.empty()) first = last;
    return true;
  });
  EXPECT_EQ(report.verdict(), Verdict::Verified) << report.why();
  EXPECT_EQ(report.snapshots_verified, 3u);
  ASSERT_EQ(first.size(), 61u);
  EXPECT_GT(std::abs(last[30].x - first[30].x) + std::abs(last[30].y - first[30].y), 100);
}

TEST_F(ThreadRecording, AChangedPlaceAndAChangedRuleAreFound) {
  const auto by_place = verify_copy([](std::string_view topic, google::protobuf::Message& message) {
    if (topic != "/frame_state") return true;
    auto& state = static_cast<proto::FrameState&>(message);
    if (state.tick() == 1600) state.mutable_threads()->back() ^= 1;
    return true;
  });
  ASSERT_EQ(by_place.verdict(), Verdict::Different);
  EXPECT_EQ(by_place.first_difference->field.substr(0, 7), "threads");
  const auto by_rule = verify_copy([](std::string_view topic, google::protobuf::Message& message) {
    if (topic == "/threads")
      static_cast<proto::ThreadRules&>(message).mutable_thread(0)->set_size(0);
    return true;
  });
  EXPECT_EQ(by_rule.verdict(), Verdict::Different);
}

TEST_F(ThreadRecording, ASessionGoesOnWithItsThreadAndAPartOfItIsVerified) {
  const auto session = resume_session(sound(), {.workers = 1});
  ASSERT_TRUE(session.ok()) << session.error().message;
  EXPECT_EQ(session->simulation.rules().threads, rules_at_the_hand());
  const auto part = folder_.file("part.mcap");
  const auto trimmed = trim(sound(), part, {.from = 1000, .to = 2000});
  ASSERT_TRUE(trimmed.ok()) << trimmed.error().message;
  const auto report = verify_journal(part);
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report->verdict(), Verdict::Verified) << report->why();
}

TEST_F(ThreadRecording, RulesOutsideTheLimitsAreRefused) {
  const auto refused = [](auto&& change) {
    proto::ThreadRules message;
    to_message(rules_at_the_hand(), message);
    change(message);
    const auto rules = from_message(message);
    return rules.ok() ? std::string() : rules.error().message;
  };
  EXPECT_EQ(refused([](auto&) {}), "");
  EXPECT_NE(refused([](auto& m) { m.clear_thread(); }), "");
  EXPECT_NE(refused([](auto& m) { m.mutable_thread(0)->set_material(4); }), "");
  EXPECT_NE(refused([](auto& m) { m.mutable_thread(0)->set_size(3); }), "");
  EXPECT_NE(refused([](auto& m) { m.mutable_thread(0)->mutable_path_m()->RemoveLast(); }), "");
  EXPECT_NE(refused([](auto& m) { m.mutable_thread(0)->mutable_start()->clear_load_n(); }), "");
  EXPECT_NE(refused([](auto& m) { m.mutable_peg(0)->set_radius_m(1e-4); }), "");
  EXPECT_NE(refused([](auto& m) { m.mutable_peg(0)->add_to_m(1); }), "");
  EXPECT_NE(refused([](auto& m) { m.set_floor_y_m(3); }), "");
  EXPECT_NE(refused([](auto& m) { m.set_gravity_m_s2(0, 1e9); }), "");
}

}  // namespace
}  // namespace trocar::recording::testing
