#include "common/wire/hand_report_messages.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "proto/journal.pb.h"
#include "proto/wire.pb.h"

namespace trocar::wire {
namespace {

HandReport report() {
  HandReport report;
  report.tool = 1;
  for (std::uint64_t i = 0; i < HandReport::kMostMoments; ++i)
    report.moments.push_back({.time_us = 5'000'000 + 16'000 * i,
                              .hand_force_n = {0.1f, -0.0123f, 0.5f * static_cast<float>(i)},
                              .model_force_n = {0, 1.25f, -999.9f},
                              .answer_age_us = static_cast<std::uint32_t>(1000 * i),
                              .limits = static_cast<std::uint32_t>(1u << i)});
  report.echo_delay_s = 0.062f;
  report.rate_hz = 999.5f;
  report.motion_scale = 1.5f;
  report.force_scale = 0.5f;
  report.device = "calculated hand";
  return report;
}

proto::HandReport message() {
  proto::HandReport message;
  write(report(), message);
  return message;
}

TEST(HandReport, IsReadAsItWasWritten) {
  const auto again = read(message());
  ASSERT_TRUE(again.ok()) << again.error().message;
  const auto expected = report();
  EXPECT_EQ(again->tool, 1);
  ASSERT_EQ(again->moments.size(), expected.moments.size());
  for (std::size_t i = 0; i < again->moments.size(); ++i) {
    const auto &a = again->moments[i], &b = expected.moments[i];
    EXPECT_EQ(a.time_us, b.time_us);
    EXPECT_LE(length(a.hand_force_n - b.hand_force_n), 1e-4f);
    EXPECT_LE(length(a.model_force_n - b.model_force_n), 2e-4f);
    EXPECT_EQ(a.answer_age_us, b.answer_age_us);
    EXPECT_EQ(a.limits, b.limits);
  }
  EXPECT_EQ(again->echo_delay_s, expected.echo_delay_s);
  EXPECT_EQ(again->rate_hz, expected.rate_hz);
  EXPECT_EQ(again->motion_scale, expected.motion_scale);
  EXPECT_EQ(again->force_scale, expected.force_scale);
  EXPECT_EQ(again->device, expected.device);
}

TEST(HandReport, IsSmall) {
  auto usual = report();
  for (auto& moment : usual.moments) {
    moment.hand_force_n = {0.1f, -0.2f, 0.6f};
    moment.model_force_n = {0.1f, -0.2f, 0.6f};
    moment.limits = 64;
  }
  usual.device.clear();
  proto::HandReport message;
  write(usual, message);
  EXPECT_LE(message.ByteSizeLong(), 8 * 20 + 40u) << "20 bytes for each moment";
  // The most that any report within its ranges takes: what bounds a recording.
  auto largest = report();
  for (auto& moment : largest.moments) {
    moment.hand_force_n = moment.model_force_n = {-1000, -1000, -1000};
    moment.answer_age_us = 60'000'000;
    moment.limits = 255;
  }
  largest.moments.front().time_us = 1ull << 62;
  for (std::size_t i = 1; i < largest.moments.size(); ++i)
    largest.moments[i].time_us = largest.moments[i - 1].time_us + 1'000'000;
  largest.device = std::string(HandReport::kMostDeviceBytes, 'd');
  write(largest, message);
  EXPECT_TRUE(read(message).ok());
  EXPECT_LE(message.ByteSizeLong(), 400u);
}

TEST(HandReport, CutShortAnywhereIsRefusedOrWithinItsRanges) {
  const std::string whole = message().SerializeAsString();
  int refused = 0;
  for (std::size_t size = 0; size < whole.size(); ++size) {
    proto::HandReport cut;
    const bool is_parsed = cut.ParseFromArray(whole.data(), static_cast<int>(size));
    const auto result =
        is_parsed ? read(cut) : Result<HandReport>(Error{ErrorCode::BadMessage, ""});
    refused += !result.ok();
    if (!result.ok()) continue;
    EXPECT_EQ(result->moments.size(), HandReport::kMostMoments);
  }
  EXPECT_GT(refused, 200);
}

TEST(HandReport, EachFieldJustInsideAndJustOutsideItsRange) {
  using Change = std::function<void(proto::HandReport&)>;
  const auto refusal = [](const Change& change) {
    auto changed = message();
    change(changed);
    const auto result = read(changed);
    return result.ok() ? std::string() : result.error().message;
  };
  constexpr float kNoNumber = std::numeric_limits<float>::quiet_NaN();
  struct Case {
    const char* field;
    std::vector<Change> inside, outside;
  };
  const std::vector<Case> cases{
      {"tool", {[](auto& m) { m.set_tool(0); }}, {[](auto& m) { m.set_tool(2); }}},
      {"first_time_us",
       {[](auto& m) { m.set_first_time_us(1); }, [](auto& m) { m.set_first_time_us(1ull << 62); }},
       {[](auto& m) { m.set_first_time_us(0); },
        [](auto& m) { m.set_first_time_us((1ull << 62) + 1); }}},
      {"later_us",
       {[](auto& m) { m.set_later_us(3, 1); }, [](auto& m) { m.set_later_us(3, 1'000'000); }},
       {[](auto& m) { m.set_later_us(3, 0); }, [](auto& m) { m.set_later_us(6, 1'000'001); }}},
      {"hand_force_quanta",
       {[](auto& m) { m.set_hand_force_quanta(23, 10'000'000); },
        [](auto& m) { m.set_hand_force_quanta(0, -10'000'000); }},
       {[](auto& m) { m.set_hand_force_quanta(23, 10'000'001); },
        [](auto& m) { m.set_hand_force_quanta(0, -10'000'001); }}},
      {"model_force_quanta",
       {[](auto& m) { m.set_model_force_quanta(0, -10'000'000); }},
       {[](auto& m) { m.set_model_force_quanta(5, std::numeric_limits<std::int32_t>::min()); }}},
      {"answer_age_us", {[](auto& m) { m.set_answer_age_us(7, 60'000'000); }}, {[](auto& m) {
         m.set_answer_age_us(7, 60'000'001);
       }}},
      {"limits",
       {[](auto& m) { m.set_limits(0, 255); }},
       {[](auto& m) { m.set_limits(0, 256); }, [](auto& m) { m.clear_limits(); },
        [](auto& m) { m.add_limits(0); }, [](auto& m) { m.add_later_us(5); },
        [](auto& m) { m.add_hand_force_quanta(5); }, [](auto& m) { m.clear_model_force_quanta(); },
        [](auto& m) { m.add_answer_age_us(5); }}},
      {"echo_delay_s",
       {[](auto& m) { m.set_echo_delay_s(60); }, [](auto& m) { m.clear_echo_delay_s(); }},
       {[](auto& m) { m.set_echo_delay_s(60.01f); }, [](auto& m) { m.set_echo_delay_s(-0.01f); },
        [](auto& m) { m.set_echo_delay_s(kNoNumber); }}},
      {"rate_hz",
       {[](auto& m) { m.set_rate_hz(20'000); }},
       {[](auto& m) { m.set_rate_hz(20'001); }, [](auto& m) { m.set_rate_hz(kNoNumber); }}},
      {"motion_scale",
       {[](auto& m) { m.set_motion_scale(100); }},
       {[](auto& m) { m.set_motion_scale(100.1f); }, [](auto& m) { m.set_motion_scale(-1); }}},
      {"force_scale",
       {[](auto& m) { m.set_force_scale(0); }},
       {[](auto& m) { m.set_force_scale(101); }, [](auto& m) { m.set_force_scale(kNoNumber); }}},
      {"device",
       {[](auto& m) { m.set_device(std::string(64, 'x')); }, [](auto& m) { m.clear_device(); }},
       {[](auto& m) { m.set_device(std::string(65, 'x')); },
        [](auto& m) { m.set_device("a\nb"); }}},
  };
  for (const auto& one : cases) {
    for (const auto& change : one.inside) EXPECT_EQ(refusal(change), "") << one.field;
    for (const auto& change : one.outside)
      EXPECT_TRUE(refusal(change).starts_with("HandReport." + std::string(one.field) + ": "))
          << one.field << ": " << refusal(change);
  }
}

TEST(HandReport, WhatIsOutOfItsRangesIsWrittenAtTheirEnds) {
  auto wild = report();
  wild.moments[2].hand_force_n = {std::numeric_limits<float>::infinity(), 1e9f, -1e9f};
  wild.moments[3].time_us = wild.moments[2].time_us + 5'000'000;
  wild.moments[4].time_us = wild.moments[3].time_us;
  wild.moments[1].answer_age_us = 4'000'000'000u;
  wild.echo_delay_s = std::numeric_limits<float>::quiet_NaN();
  wild.rate_hz = -1;
  wild.device = "a\nname that is too long for anybody to read it without being annoyed by it";
  proto::HandReport message;
  write(wild, message);
  const auto read_back = read(message);
  ASSERT_TRUE(read_back.ok()) << read_back.error().message;
  EXPECT_EQ(read_back->moments[2].hand_force_n, (Vec3f{0, 1000, -1000}));
  EXPECT_EQ(read_back->echo_delay_s, 0);
  EXPECT_TRUE(read_back->device.starts_with("a?name"));
}

TEST(HandReport, ARecordKeepsItsPlaceInTheSession) {
  HandRecord record{
      .tool = {5}, .report = report(), .tick = 4096, .echo_time_us = 77, .left_out = 3};
  proto::HandLog log;
  write(record, log);
  const auto again = read(log);
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(again->tool, record.tool);
  EXPECT_EQ(again->tick, 4096u);
  EXPECT_EQ(again->echo_time_us, 77u);
  EXPECT_EQ(again->left_out, 3u);
  log.set_tool(kMaxTools);
  EXPECT_FALSE(read(log).ok());
}

}  // namespace
}  // namespace trocar::wire
