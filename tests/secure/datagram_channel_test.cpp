// DTLS between two ends in one thread; the test is the network and may lose, repeat or forge.

#include <gtest/gtest.h>

#include <deque>
#include <thread>

#include "common/secure/datagram_channel.h"

namespace trocar::secure {
namespace {

using State = DatagramChannel::State;

DatagramKey make_key(std::uint8_t seed) {
  DatagramKey key;
  key.secret.fill(seed);
  key.id.fill(static_cast<std::uint8_t>(seed + 1));
  return key;
}

// A client, a listener that knows one key, and the datagrams between them.
struct Link {
  explicit Link(const DatagramKey& client_key, const DatagramKey& server_key)
      : listener([server_key](const auto& id) {
          return id == server_key.id ? std::optional(server_key.secret) : std::nullopt;
        }),
        client(DatagramChannel::make_client(
            client_key, [this](BytesView bytes) { up.emplace_back(bytes.begin(), bytes.end()); })) {
  }

  void hand_up(const Bytes& datagram) {
    const auto send = [this](BytesView bytes) { down.emplace_back(bytes.begin(), bytes.end()); };
    const auto deliver = [this](BytesView message) {
      at_server.emplace_back(message.begin(), message.end());
    };
    if (server)
      server->receive(datagram, deliver);
    else
      server = listener.receive(datagram, address, send);
  }
  void hand_down(const Bytes& datagram) {
    client->receive(datagram, [this](BytesView message) {
      at_client.emplace_back(message.begin(), message.end());
    });
  }
  // Delivers all that is under way, until nothing is.
  void settle() {
    while (!up.empty() || !down.empty()) {
      if (!up.empty()) {
        const auto datagram = std::move(up.front());
        up.pop_front();
        hand_up(datagram);
      }
      if (!down.empty()) {
        const auto datagram = std::move(down.front());
        down.pop_front();
        hand_down(datagram);
      }
    }
  }
  void shake() {
    client->start();
    settle();
  }

  std::string address = "192.0.2.1:5000";
  std::deque<Bytes> up, down;
  std::vector<Bytes> at_server, at_client;
  DatagramListener listener;
  std::unique_ptr<DatagramChannel> client, server;
};

Bytes message_of(std::size_t size) {
  Bytes bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::uint8_t>(i * 7);
  return bytes;
}

TEST(DatagramChannel, carries_messages_both_ways_within_the_limit) {
  Link link(make_key(1), make_key(1));
  link.shake();
  ASSERT_EQ(link.client->state(), State::Open);
  ASSERT_TRUE(link.server);
  ASSERT_EQ(link.server->state(), State::Open);
  EXPECT_EQ(link.server->key_id(), make_key(1).id);

  const auto largest = message_of(kDatagramMessageBytes);
  ASSERT_TRUE(link.client->send(largest));
  ASSERT_EQ(link.up.size(), 1u);
  EXPECT_EQ(link.up.front().size(), kDatagramBytes);
  EXPECT_TRUE(link.server->send(message_of(3)));
  link.settle();
  ASSERT_EQ(link.at_server.size(), 1u);
  EXPECT_EQ(link.at_server[0], largest);
  ASSERT_EQ(link.at_client.size(), 1u);
  EXPECT_EQ(link.at_client[0], message_of(3));
  EXPECT_FALSE(link.client->send(message_of(kDatagramMessageBytes + 1)));
}

TEST(DatagramChannel, another_key_never_opens) {
  auto forged = make_key(1);
  forged.secret.fill(9);
  Link link(forged, make_key(1));
  link.shake();
  EXPECT_NE(link.client->state(), State::Open);
  ASSERT_TRUE(link.server);
  EXPECT_NE(link.server->state(), State::Open);
  Link unknown(make_key(5), make_key(1));
  unknown.shake();
  EXPECT_NE(unknown.client->state(), State::Open);
}

TEST(DatagramChannel, replayed_forged_and_garbled_datagrams_are_dropped) {
  Link link(make_key(1), make_key(1));
  link.shake();
  ASSERT_TRUE(link.client->send(message_of(100)));
  const auto datagram = link.up.front();
  link.settle();
  ASSERT_EQ(link.at_server.size(), 1u);
  link.hand_up(datagram);
  EXPECT_EQ(link.at_server.size(), 1u) << "replayed";
  for (std::size_t i = 0; i < datagram.size(); ++i) {
    auto garbled = datagram;
    garbled[i] ^= 1u;
    link.hand_up(garbled);
    link.hand_up(Bytes(datagram.begin(), datagram.begin() + static_cast<std::ptrdiff_t>(i)));
  }
  EXPECT_EQ(link.at_server.size(), 1u) << "garbled or cut";
  Link other(make_key(2), make_key(2));
  other.shake();
  ASSERT_TRUE(other.client->send(message_of(100)));
  link.hand_up(other.up.front());
  EXPECT_EQ(link.at_server.size(), 1u) << "of another session";
  ASSERT_TRUE(link.client->send(message_of(4)));
  link.settle();
  EXPECT_EQ(link.at_server.size(), 2u) << "the session goes on";
}

// A record as anybody can write it who knows the address.
Bytes record_of(int kind, int key_epoch, std::size_t size) {
  const auto type = static_cast<std::uint8_t>(kind), epoch = static_cast<std::uint8_t>(key_epoch);
  Bytes record{type, 0xfe, 0xfd, 0, epoch, 0, 0, 0, 0, 0, 99, 0, static_cast<std::uint8_t>(size)};
  record.resize(record.size() + size, 2);  // of an alert: it is fatal
  return record;
}

TEST(DatagramChannel, records_without_a_key_end_neither_side) {
  Link link(make_key(1), make_key(1));
  link.shake();
  for (const int type : {20, 21, 22, 23, 24})
    for (const int epoch : {0, 1, 2})
      for (std::size_t size = 0; size < 64; ++size) {
        link.hand_up(record_of(type, epoch, size));
        link.hand_down(record_of(type, epoch, size));
        ASSERT_EQ(link.server->state(), State::Open) << type << ' ' << epoch << ' ' << size;
        ASSERT_EQ(link.client->state(), State::Open) << type << ' ' << epoch << ' ' << size;
      }
  link.up.clear();
  link.down.clear();
  ASSERT_TRUE(link.client->send(message_of(1)));
  ASSERT_TRUE(link.server->send(message_of(2)));
  link.settle();
  EXPECT_EQ(link.at_server.size(), 1u);
  EXPECT_EQ(link.at_client.size(), 1u);
}

TEST(DatagramChannel, alerts_without_a_key_end_no_handshake) {
  Link link(make_key(1), make_key(1));
  link.client->start();
  for (int i = 0; i < 20 && !(link.up.empty() && link.down.empty()); ++i)
    for (auto* way : {&link.up, &link.down}) {
      if (way->empty()) continue;
      const auto datagram = std::move(way->front());
      way->pop_front();
      for (const int epoch : {0, 1})
        way == &link.up ? link.hand_up(record_of(21, epoch, 2))
                        : link.hand_down(record_of(21, epoch, 2));
      way == &link.up ? link.hand_up(datagram) : link.hand_down(datagram);
    }
  EXPECT_EQ(link.client->state(), State::Open);
  ASSERT_TRUE(link.server);
  EXPECT_EQ(link.server->state(), State::Open);
}

TEST(DatagramChannel, an_address_is_proved_before_anything_is_kept_or_sent_in_bulk) {
  Link link(make_key(1), make_key(1));
  link.client->start();
  ASSERT_EQ(link.up.size(), 1u);
  const auto hello = link.up.front();
  link.hand_up(hello);
  EXPECT_FALSE(link.server);
  ASSERT_EQ(link.down.size(), 1u);
  EXPECT_LE(link.down.front().size(), hello.size());
  // The cookie is of this address: it does not open from another.
  link.hand_down(link.down.front());
  link.down.clear();
  link.address = "192.0.2.9:5000";
  link.hand_up(link.up.back());
  EXPECT_FALSE(link.server);
  link.address = "192.0.2.1:5000";
  link.hand_up(link.up.back());
  EXPECT_TRUE(link.server);
}

TEST(DatagramChannel, opens_though_each_flight_is_lost_once) {
  Link link(make_key(1), make_key(1));
  link.client->start();
  for (int round = 0; round < 200 && link.client->state() == State::Shaking; ++round) {
    // Every other round loses what is under way.
    if (round % 2 == 0) {
      link.up.clear();
      link.down.clear();
    } else {
      link.settle();
    }
    const auto wait = link.client->next_timeout();
    if (!wait) break;
    std::this_thread::sleep_for(*wait);
    link.client->on_timeout();
    if (link.server) link.server->on_timeout();
  }
  EXPECT_EQ(link.client->state(), State::Open);
}

TEST(DatagramListener, noise_makes_no_channel) {
  Link link(make_key(1), make_key(1));
  for (std::size_t size = 0; size < 300; ++size) {
    link.hand_up(message_of(size));
    ASSERT_FALSE(link.server);
  }
  EXPECT_TRUE(link.down.empty());
  link.shake();
  EXPECT_EQ(link.client->state(), State::Open);
}

}  // namespace
}  // namespace trocar::secure
