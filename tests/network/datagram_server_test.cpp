// A server's datagrams over real sockets, with strangers beside those who have a key.

#include "server/session/net/datagram_server.h"

#include <gtest/gtest.h>

#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <thread>
#include <vector>

namespace trocar::net {
namespace {

using asio::ip::udp;
using State = secure::DatagramChannel::State;

secure::DatagramKey key_of(std::uint8_t seed) {
  secure::DatagramKey key;
  key.secret.fill(seed);
  key.id.fill(seed);
  return key;
}

asio::ip::address address_of(const char* text) {
  return asio::ip::make_address(text);
}

std::uint16_t free_port() {
  asio::io_context context;
  return udp::socket(context, {address_of("127.0.0.1"), 0}).local_endpoint().port();
}

class DatagramServerTest : public ::testing::Test {
 protected:
  // Somebody whose socket takes datagrams of that server address alone, as a firewall does.
  struct Peer {
    Peer(DatagramServerTest& test, const char* from, const char* to, std::uint8_t seed)
        : socket(test.context_, {address_of(from), 0}),
          channel(secure::DatagramChannel::make_client(key_of(seed), [this](BytesView bytes) {
            socket.send(asio::buffer(bytes.data(), bytes.size()));
          })) {
      socket.connect({address_of(to), test.port_});
      socket.non_blocking(true);
      channel->start();
    }
    void receive() {
      Bytes room(2048);
      boost::system::error_code error;
      while (const auto count = socket.receive(asio::buffer(room), 0, error))
        channel->receive(BytesView(room).first(count), [](BytesView) {});
    }
    udp::socket socket;
    std::unique_ptr<secure::DatagramChannel> channel;
  };

  void open(const char* address) {
    auto made = DatagramServer::open(context_, {address_of(address), port_},
                                     [this](ConnectionId id, BytesView) { heard_.push_back(id); });
    ASSERT_TRUE(made.ok()) << made.error().message;
    server_ = std::move(*made);
    for (std::uint8_t seed = 1; seed < 4; ++seed) server_->expect(seed, key_of(seed));
  }
  // True once the peer's handshake is done on both sides.
  bool opens(Peer& peer, ConnectionId id) {
    for (int i = 0; i < 2000; ++i) {
      context_.poll();
      peer.receive();
      if (peer.channel->state() == State::Open && server_->has_path(id)) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return false;
  }

  asio::io_context context_{1};
  const std::uint16_t port_ = free_port();
  std::unique_ptr<DatagramServer> server_;
  std::vector<ConnectionId> heard_;
};

TEST_F(DatagramServerTest, answers_from_the_address_that_was_asked) {
  open("0.0.0.0");
  Peer peer(*this, "127.0.0.1", "127.0.0.2", 1);
  EXPECT_TRUE(opens(peer, 1));
}

TEST_F(DatagramServerTest, answers_from_the_address_that_was_asked_by_either_protocol) {
  open("::");
  Peer old(*this, "127.0.0.1", "127.0.0.2", 1), peer(*this, "::1", "::1", 2);
  EXPECT_TRUE(opens(old, 1));
  EXPECT_TRUE(opens(peer, 2));
}

TEST_F(DatagramServerTest, strangers_who_leave_handshakes_unfinished_keep_nobody_out) {
  open("127.0.0.1");
  Peer present(*this, "127.0.0.1", "127.0.0.1", 1);
  ASSERT_TRUE(opens(present, 1));
  std::vector<std::unique_ptr<Peer>> strangers;
  for (const char* from : {"127.0.0.8", "127.0.0.9"})
    for (int i = 0; i < 100; ++i) {
      auto& stranger =
          *strangers.emplace_back(std::make_unique<Peer>(*this, from, "127.0.0.1", 99));
      context_.poll();
      stranger.receive();  // the cookie goes back, and nothing more
      context_.poll();
    }
  EXPECT_GT(server_->counters().refused, 100u) << "they drive out each other";
  Peer other(*this, "127.0.0.1", "127.0.0.1", 2), beside(*this, "127.0.0.9", "127.0.0.1", 3);
  EXPECT_TRUE(opens(other, 2));
  EXPECT_TRUE(opens(beside, 3)) << "from the address of a stranger";
  ASSERT_TRUE(present.channel->send(Bytes{7}));
  for (int i = 0; i < 1000 && heard_.empty(); ++i) {
    context_.poll();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_EQ(heard_, std::vector<ConnectionId>{1}) << "who was there notices nothing";
}

// The attack of one datagram: its sender has no key, and writes as if it were the peer.
TEST_F(DatagramServerTest, an_alert_without_a_key_leaves_a_path_alone) {
  open("127.0.0.1");
  Peer peer(*this, "127.0.0.1", "127.0.0.1", 1);
  ASSERT_TRUE(opens(peer, 1));
  const Bytes alert{21, 0xfe, 0xfd, 0, 1, 0, 0, 0, 0, 0, 99, 0, 2, 2, 40};
  peer.socket.send(asio::buffer(alert));
  ASSERT_TRUE(peer.channel->send(Bytes{7}));
  for (int i = 0; i < 1000 && heard_.empty(); ++i) {
    context_.poll();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_EQ(heard_, std::vector<ConnectionId>{1});
  EXPECT_TRUE(server_->has_path(1));
}

}  // namespace
}  // namespace trocar::net
