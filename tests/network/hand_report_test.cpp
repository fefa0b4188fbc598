// Reports of what hands have felt, on their way into a recording: what is handed on, and what ends
// a session.

#include <functional>
#include <mutex>

#include "common/wire/hand_report_messages.h"
#include "tests/network/session_fixture.h"

namespace trocar::testing {
namespace {

proto::Envelope make_report(std::uint64_t time_us, std::size_t moments = 8) {
  wire::HandReport report;
  for (std::size_t i = 0; i < moments; ++i)
    report.moments.push_back({.time_us = time_us + 16'000 * i, .hand_force_n = {0, 0.5f, 0}});
  proto::Envelope envelope;
  wire::write(report, *envelope.mutable_hand_report());
  return envelope;
}

class HandReports : public ::testing::Test {
 protected:
  HandReports() : session_({}, options()) { session_.publish(10); }

  replication::ReplicatorOptions options() {
    replication::ReplicatorOptions options;
    options.on_hand_report = [this](wire::HandRecord record) {
      records_.push_back(std::move(record));
    };
    options.clock_ns = [this] { return clock_ns_.load(); };
    return options;
  }
  std::size_t record_count() {
    return session_.on_io([&] { return records_.size(); });
  }
  // Whether the session still answers.
  static bool is_well(RawClient& client) {
    proto::Envelope ping;
    ping.mutable_ping()->set_client_time_us(1);
    return client.send(ping) && client.receive(proto::Envelope::kPong).has_value();
  }

  std::atomic<std::uint64_t> clock_ns_{1'000'000'000'000};
  std::vector<wire::HandRecord> records_;  // I/O thread
  LiveSession session_;
};

TEST_F(HandReports, are_handed_on_with_the_tick_and_the_time_of_its_pose) {
  RawClient client(session_.port());
  ASSERT_TRUE(client.join("Anna", proto::ROLE_SURGEON));
  auto frame = std::make_shared<step::PublishedFrame>(*session_.make_frame(5));
  frame->tools.push_back({.tool = tool_slot({0}, 0)});
  frame->tools.back().touch.echo_time_us = 4'900'000;
  session_.publish_all({frame});
  ASSERT_TRUE(client.send(make_report(5'000'000)));
  ASSERT_TRUE(is_well(client));
  ASSERT_EQ(record_count(), 1u);
  const auto& record = records_.front();
  EXPECT_EQ(record.tool, tool_slot({0}, 0));
  EXPECT_EQ(record.tick, frame->tick);
  EXPECT_EQ(record.echo_time_us, 4'900'000u);
  EXPECT_EQ(record.report.moments.size(), 8u);
  EXPECT_EQ(record.report.moments[7].time_us, 5'112'000u);
  hands::TickInputs inputs;
  session_.inbox.drain(inputs);
  EXPECT_TRUE(inputs.samples.empty()) << "no input of a tick";
}

TEST_F(HandReports, of_who_has_no_tools_or_not_so_many_end_the_session) {
  for (const auto role : {proto::ROLE_OBSERVER, proto::ROLE_INSTRUCTOR}) {
    RawClient client(session_.port());
    ASSERT_TRUE(client.join("watcher", role));
    ASSERT_TRUE(client.send(make_report(5'000'000)));
    const auto goodbye = client.read_goodbye();
    ASSERT_TRUE(goodbye);
    EXPECT_EQ(goodbye->reason(), proto::GOODBYE_ROLE);
    ASSERT_TRUE(session_.wait_for_sessions(0));
  }
  RawClient client(session_.port());
  ASSERT_TRUE(client.join("Anna", proto::ROLE_SURGEON));
  auto report = make_report(5'000'000);
  report.mutable_hand_report()->set_tool(1);
  ASSERT_TRUE(client.send(report));
  const auto goodbye = client.read_goodbye();
  ASSERT_TRUE(goodbye);
  EXPECT_EQ(goodbye->reason(), proto::GOODBYE_PROTOCOL_ERROR);
  EXPECT_TRUE(goodbye->text().starts_with("HandReport.tool")) << goodbye->text();
  EXPECT_EQ(record_count(), 0u);
}

TEST_F(HandReports, out_of_range_end_the_session_with_the_field) {
  RawClient client(session_.port());
  ASSERT_TRUE(client.join("Anna", proto::ROLE_SURGEON));
  auto report = make_report(5'000'000);
  report.mutable_hand_report()->set_limits(0, 256);
  ASSERT_TRUE(client.send(report));
  const auto goodbye = client.read_goodbye();
  ASSERT_TRUE(goodbye);
  EXPECT_EQ(goodbye->reason(), proto::GOODBYE_PROTOCOL_ERROR);
  EXPECT_TRUE(goodbye->text().starts_with("HandReport.limits")) << goodbye->text();
  EXPECT_EQ(record_count(), 0u);
}

TEST_F(HandReports, more_than_150_moments_a_second_end_the_session) {
  RawClient client(session_.port());
  ASSERT_TRUE(client.join("Anna", proto::ROLE_SURGEON));
  std::uint64_t time_us = 5'000'000;
  const auto send = [&](int reports) {
    for (int i = 0; i < reports; ++i, time_us += 128'000) client.send(make_report(time_us));
  };
  send(18);  // 144 moments
  ASSERT_TRUE(is_well(client));
  clock_ns_ += 1'000'000'000;
  send(18);
  ASSERT_TRUE(is_well(client));
  send(2);
  const auto goodbye = client.read_goodbye();
  ASSERT_TRUE(goodbye);
  EXPECT_NE(goodbye->text().find("150 moments"), std::string::npos) << goodbye->text();
  EXPECT_EQ(record_count(), 37u);
  EXPECT_EQ(session_.on_io([&] { return session_.replicator().counters().floods; }), 1u);
}

}  // namespace
}  // namespace trocar::testing
