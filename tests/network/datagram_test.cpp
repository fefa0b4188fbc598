// Frames and samples as datagrams, over real sockets and through a bad network.

#include <functional>

#include "client/net/net_source.h"
#include "client/replica/replica.h"
#include "common/impair/proxy.h"
#include "common/wire/surface_codec.h"
#include "tests/network/tls_fixture.h"

namespace trocar::testing {
namespace {

using namespace std::chrono_literals;
using impair::Impairment;
using wire::Role;

// A proxy on a thread of its own.
class BadNetwork {
 public:
  BadNetwork(std::uint16_t server_port, impair::ProxyOptions options) {
    options.listen_port = 0;
    options.server_port = server_port;
    auto proxy = impair::Proxy::listen(context_, options);
    EXPECT_TRUE(proxy.ok());
    proxy_ = std::move(*proxy);
    proxy_->start();
    thread_ = std::thread([this] { context_.run(); });
  }
  ~BadNetwork() {
    asio::post(context_, [this] { proxy_->stop(); });
    context_.stop();
    thread_.join();
  }
  std::uint16_t port() const { return proxy_->port(); }

 private:
  asio::io_context context_{1};
  std::unique_ptr<impair::Proxy> proxy_;
  std::thread thread_;
};

// Somebody in a session, with the replica that a client has.
struct Trainee {
  Trainee(const GuardedSession& session, std::uint16_t port, Role role = Role::Surgeon,
          bool wants_datagrams = true)
      : source(options(session, port, role, wants_datagrams)),
        replica([this](const proto::Envelope& message) { return source.send(message); }) {}

  static net::NetSourceOptions options(const GuardedSession& session, std::uint16_t port, Role role,
                                       bool wants_datagrams) {
    net::NetSourceOptions options;
    options.port = port;
    options.participant_name = "Anna";
    options.role = static_cast<int>(role);
    options.connect_deadline = 8s;
    options.tls = secure::make_client_context();
    options.join_code = [code = session.code(role)] { return Result<secure::JoinCode>(code); };
    options.wants_datagrams = wants_datagrams;
    return options;
  }

  net::NetSource source;
  replica::Replica replica;
};

// Publishes a frame and lets some time pass, until `is_done`; false after `most` frames.
bool play(GuardedSession& guarded, Trainee& trainee, int most, const std::function<bool()>& is_done,
          int cut_every = 0) {
  for (int i = 1; i <= most; ++i) {
    const bool is_cut = cut_every > 0 && i % cut_every == 0;
    guarded.session->publish_all({guarded.session->make_frame(40, is_cut)});
    for (int slice = 0; slice < 4; ++slice) {
      trainee.source.poll(trainee.replica);
      std::this_thread::sleep_for(1ms);
    }
    if (is_done()) return true;
  }
  return false;
}

// Publishes single frames with pauses, since any may be lost, until the trainee has the newest.
bool catches_up(GuardedSession& guarded, Trainee& trainee) {
  for (int i = 0; i < 50; ++i) {
    const auto frame = guarded.session->publish(3);
    for (int wait = 0; wait < 60; ++wait) {
      trainee.source.poll(trainee.replica);
      const auto* newest = trainee.replica.newest();
      if (newest != nullptr && newest->frame == frame->frame)
        return newest->surface == frame->surface;
      std::this_thread::sleep_for(1ms);
    }
  }
  return false;
}

void expect_right(const Trainee& trainee) {
  ASSERT_TRUE(trainee.replica.fault().ok()) << trainee.replica.fault().error().message;
  ASSERT_NE(trainee.replica.newest(), nullptr);
  EXPECT_EQ(wire::surface_crc(trainee.replica.newest()->surface), trainee.replica.surface_crc());
  EXPECT_EQ(trainee.replica.counters().crc_mismatches, 0u);
  EXPECT_EQ(trainee.replica.counters().base_mismatches, 0u);
}

TEST(Datagrams, carry_frames_and_samples_where_there_is_tls) {
  GuardedSession guarded;
  guarded.session->publish(10);
  Trainee trainee(guarded, guarded.session->port());
  const auto& counters = trainee.replica.counters();
  ASSERT_TRUE(play(guarded, trainee, 2000, [&] { return counters.by_datagram >= 50; }));
  const auto by_stream = counters.frames - counters.by_datagram;
  for (std::uint32_t i = 1; i <= 100; ++i) {
    ASSERT_TRUE(trainee.source.send(make_sample(i)));
    play(guarded, trainee, 1, [] { return true; });
  }
  EXPECT_EQ(counters.frames - counters.by_datagram, by_stream) << "the stream rests";
  EXPECT_TRUE(play(guarded, trainee, 500, [&] {
    return guarded.session->on_io(
               [&] { return guarded.session->replicator().counters().samples; }) == 100;
  })) << "each counted once";
  EXPECT_GT(trainee.source.statistics().datagram_bytes_received, 1000u);
  EXPECT_TRUE(trainee.source.statistics().has_server_clock);
  expect_right(trainee);
}

TEST(Datagrams, who_does_not_want_them_gets_the_stream) {
  GuardedSession guarded;
  guarded.session->publish(10);
  Trainee trainee(guarded, guarded.session->port(), Role::Observer, false);
  ASSERT_TRUE(play(guarded, trainee, 500, [&] { return trainee.replica.counters().frames >= 50; }));
  EXPECT_EQ(trainee.replica.counters().by_datagram, 0u);
  expect_right(trainee);
}

TEST(Datagrams, losses_reordering_and_duplicates_leave_the_surface_right) {
  GuardedSession guarded;
  guarded.session->publish(10);
  const Impairment bad{.delay = 5ms, .jitter = 4ms, .loss = 0.15, .reorder = 0.1, .duplicate = 0.1};
  BadNetwork network(guarded.session->port(), {.up = bad, .down = bad});
  Trainee trainee(guarded, network.port());
  const auto& counters = trainee.replica.counters();
  ASSERT_TRUE(play(
      guarded, trainee, 4000, [&] { return counters.by_datagram >= 200; }, 60));
  EXPECT_TRUE(catches_up(guarded, trainee));
  expect_right(trainee);
  EXPECT_GT(counters.surface_changes, 2u);
  const auto* newest = trainee.replica.newest();
  EXPECT_EQ(newest->surface.size(), guarded.session->layout().vertex_count());
}

TEST(Datagrams, blocked_midway_the_stream_takes_over_and_they_return) {
  GuardedSession guarded;
  guarded.session->publish(10);
  BadNetwork network(guarded.session->port(), {.blocked = {.begin = 3s, .end = 6s}});
  Trainee trainee(guarded, network.port());
  const auto& counters = trainee.replica.counters();
  ASSERT_TRUE(play(guarded, trainee, 2000, [&] { return counters.by_datagram >= 50; }));
  const auto by_stream = counters.frames - counters.by_datagram;
  ASSERT_TRUE(play(guarded, trainee, 2000, [&] {
    return counters.frames - counters.by_datagram >= by_stream + 40;
  })) << "the stream has taken over";
  const auto by_datagram = counters.by_datagram;
  ASSERT_TRUE(play(guarded, trainee, 4000, [&] {
    return counters.by_datagram >= by_datagram + 100;
  })) << "datagrams are back";
  expect_right(trainee);
}

TEST(Datagrams, noise_at_the_port_changes_nothing) {
  GuardedSession guarded;
  guarded.session->publish(10);
  Trainee trainee(guarded, guarded.session->port());
  const auto& counters = trainee.replica.counters();
  asio::io_context io;
  asio::ip::udp::socket noise(io, asio::ip::udp::v4());
  noise.connect({asio::ip::address_v4::loopback(), guarded.session->port()});
  std::mt19937 random(4);
  ASSERT_TRUE(play(guarded, trainee, 2000, [&] {
    Bytes bytes(random() % 1400);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
    boost::system::error_code ignored;
    noise.send(asio::buffer(bytes), 0, ignored);
    return counters.by_datagram >= 100;
  }));
  expect_right(trainee);
  const auto figures =
      guarded.session->on_io([&] { return guarded.session->tcp().datagram_counters(); });
  EXPECT_EQ(figures.paths, 1u);
}

}  // namespace
}  // namespace trocar::testing
