// The proxy with real sockets on this machine. Its decisions have tests of their own: here bytes,
// orders and counts are compared, never how long something took.

#include "common/impair/proxy.h"

#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <chrono>
#include <future>
#include <thread>

#include "common/impair/stream_line.h"
#include "tests/impair/pattern.h"

namespace trocar::impair {
namespace {

using asio::ip::tcp;
using asio::ip::udp;
using std::chrono::milliseconds;
using namespace std::chrono_literals;

// A proxy on a thread of its own, and a server of plain sockets behind it.
class ProxyTest : public ::testing::Test {
 protected:
  ~ProxyTest() override {
    if (!thread_.joinable()) return;
    asio::post(context_, [this] { context_.stop(); });
    thread_.join();
  }

  void start(ProxyOptions options) {
    options.listen_port = 0;
    options.server_port = acceptor_.local_endpoint().port();
    auto proxy = Proxy::listen(context_, options);
    ASSERT_TRUE(proxy) << proxy.error().message;
    proxy_ = std::move(*proxy);
    proxy_->start();
    thread_ = std::thread([this] { context_.run(); });
  }

  // Returns what `read` returns on the proxy's thread.
  template <typename Read>
  auto ask(Read read) {
    std::packaged_task<decltype(read())()> task(read);
    auto answer = task.get_future();
    asio::post(context_, [&task] { task(); });
    return answer.get();
  }
  template <typename Condition>
  void wait_until(Condition condition) {
    while (!ask(condition)) std::this_thread::sleep_for(1ms);
  }
  const Network& network() const { return proxy_->network(); }

  tcp::socket connect() {
    tcp::socket socket(outside_);
    socket.connect({asio::ip::address_v4::loopback(), proxy_->port()});
    return socket;
  }
  udp::socket peer() {
    udp::socket socket(outside_, udp::v4());
    socket.connect({asio::ip::address_v4::loopback(), proxy_->port()});
    return socket;
  }
  static void send(udp::socket& socket, std::uint32_t number) {
    socket.send(asio::buffer(&number, sizeof number));
  }
  // Returns the number in the next datagram that the server gets, and who it is from.
  std::uint32_t receive(udp::endpoint& from) {
    std::uint32_t number = 0;
    datagrams_.receive_from(asio::buffer(&number, sizeof number), from);
    return number;
  }

  asio::io_context outside_, context_{1};
  tcp::acceptor acceptor_{outside_, {asio::ip::address_v4::loopback(), 0}};
  udp::socket datagrams_{outside_, {asio::ip::address_v4::loopback(), server_port()}};
  std::unique_ptr<Proxy> proxy_;
  std::thread thread_;

 private:
  std::uint16_t server_port() { return acceptor_.local_endpoint().port(); }
};

TEST_F(ProxyTest, AStreamPassesWholeAndInOrderUnderLossAndJitter) {
  const Impairment bad{.delay = 2ms, .jitter = 5ms, .loss = 0.1, .burst = 2};
  start({.up = bad, .down = bad});
  const auto sent = pattern(300'000);
  std::thread echo([&] {
    auto socket = acceptor_.accept();
    Bytes chunk(10'000);
    boost::system::error_code error;
    while (!error) {
      const auto count = socket.read_some(asio::buffer(chunk), error);
      asio::write(socket, asio::buffer(chunk, count));
    }
  });
  auto client = connect();
  std::thread writer([&] {
    asio::write(client, asio::buffer(sent));
    client.shutdown(tcp::socket::shutdown_send);
  });
  Bytes received;
  boost::system::error_code error;
  asio::read(client, asio::dynamic_buffer(received), error);
  EXPECT_EQ(error, asio::error::eof);
  EXPECT_EQ(received, sent);
  writer.join();
  echo.join();
  wait_until([&] { return proxy_->stream_count() == 0; });
  EXPECT_EQ(network().up.stream.passed.bytes, sent.size());
  EXPECT_EQ(network().down.stream.passed.bytes, sent.size());
  EXPECT_GT(network().up.stream.lost.packets, 0u);
}

TEST_F(ProxyTest, TheDatagramsAreLostThatTheSeedSays) {
  constexpr std::uint32_t kCount = 2000;
  const Impairment bad{.loss = 0.2, .burst = 3};
  start({.up = bad, .seed = 5});
  LossRuns losses(bad);
  const Draws draws(seed_of(5, Flow::DatagramsUp, 0));
  auto client = peer();
  std::vector<std::uint32_t> expected, received;
  udp::endpoint from;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    if (!losses.next(draws.draw(i, Purpose::Loss))) expected.push_back(i);
    send(client, i);
    if (i % 20 != 19) continue;  // no kernel loses any while so few are on their way
    wait_until([&] {
      return network().up.datagrams.passed.packets + network().up.datagrams.lost.packets == i + 1;
    });
    while (received.size() < expected.size()) received.push_back(receive(from));
  }
  EXPECT_EQ(received, expected);
  EXPECT_NEAR(static_cast<double>(received.size()), 0.8 * kCount, 0.06 * kCount);
}

TEST_F(ProxyTest, PeersOfDatagramsAreToldApart) {
  start({.server_host = "localhost", .up = {.delay = 1ms}});
  auto first = peer(), second = peer();
  udp::endpoint from_first, from_second;
  send(first, 1);
  EXPECT_EQ(receive(from_first), 1u);
  send(second, 2);
  EXPECT_EQ(receive(from_second), 2u);
  EXPECT_NE(from_first, from_second);
  std::uint32_t number = 20;
  datagrams_.send_to(asio::buffer(&number, sizeof number), from_second);
  number = 10;
  datagrams_.send_to(asio::buffer(&number, sizeof number), from_first);
  first.receive(asio::buffer(&number, sizeof number));
  EXPECT_EQ(number, 10u);
  second.receive(asio::buffer(&number, sizeof number));
  EXPECT_EQ(number, 20u);
}

TEST_F(ProxyTest, BlockedDatagramsComeBackAndTheStreamGoesOnMeanwhile) {
  start({.blocked = {.begin = 0ms, .end = 400ms}});
  auto client = connect();
  auto server = acceptor_.accept();
  std::uint8_t byte = 3;
  asio::write(client, asio::buffer(&byte, 1));
  asio::read(server, asio::buffer(&byte, 1));
  auto datagrams = peer();
  std::uint32_t sent = 0;
  while (ask([&] { return network().up.datagrams.passed.packets == 0; })) {
    send(datagrams, sent++);
    std::this_thread::sleep_for(5ms);
  }
  udp::endpoint from;
  const auto first = receive(from);
  EXPECT_EQ(first, ask([&] { return network().up.datagrams.blocked.packets; }));
  EXPECT_GE(ask([&] { return network().now(); }), 400ms);
}

TEST_F(ProxyTest, BlockedForGoodNoDatagramPasses) {
  start({.blocked = {.begin = 0ms}});
  auto client = peer();
  for (std::uint32_t i = 0; i < 50; ++i) send(client, i);
  wait_until([&] { return network().up.datagrams.blocked.packets == 50; });
  EXPECT_EQ(datagrams_.available(), 0u);
}

TEST_F(ProxyTest, ACutStreamGoesOnWithoutABreak) {
  start({.cut = {.begin = 0ms, .end = 300ms}});
  auto client = connect();
  auto server = acceptor_.accept();
  const auto sent = pattern(50'000);
  asio::write(client, asio::buffer(sent));
  Bytes received(sent.size());
  asio::read(server, asio::buffer(received));
  EXPECT_EQ(received, sent);
  EXPECT_GE(ask([&] { return network().now(); }), 300ms);
  asio::write(server, asio::buffer(sent, 100));
  asio::read(client, asio::buffer(received, 100));
  EXPECT_EQ(ask([&] { return proxy_->stream_count(); }), 1u);
}

TEST_F(ProxyTest, APeerThatDoesNotReadTakesNoMoreThanTheBound) {
  start({});
  auto client = connect();
  auto server = acceptor_.accept();
  client.non_blocking(true);
  const auto chunk = pattern(64 * 1024);
  std::size_t sent = 0, refusals = 0;
  boost::system::error_code error;
  while (refusals < 100 && sent < 64u << 20) {
    const auto at = sent % chunk.size();
    sent += client.write_some(asio::buffer(chunk) + at, error);
    if (error != asio::error::would_block) continue;
    ++refusals;
    std::this_thread::sleep_for(2ms);
  }
  EXPECT_LT(sent, 64u << 20);
  EXPECT_LE(ask([&] { return proxy_->stream_waiting_bytes(); }), StreamLine::kMostBytes + 80'000);
  Bytes received(sent);
  asio::read(server, asio::buffer(received));
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < sent; ++i) wrong += received[i] != chunk[i % chunk.size()];
  EXPECT_EQ(wrong, 0u);
}

// The backlog before a slow link lies with the sender, who can see it, not in the proxy.
TEST_F(ProxyTest, ASlowLinkHoldsLittle) {
  start({.up = {.rate = 10'000, .queue = 100ms}});
  auto client = connect();
  auto server = acceptor_.accept();
  client.non_blocking(true);
  client.set_option(asio::socket_base::send_buffer_size(4096));
  const auto chunk = pattern(4096);
  std::size_t sent = 0, refusals = 0;
  boost::system::error_code error;
  while (refusals < 20 && sent < 1u << 20) {
    sent += client.write_some(asio::buffer(chunk), error);
    if (error != asio::error::would_block) continue;
    ++refusals;
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_LT(sent, 100'000u);
  EXPECT_LE(ask([&] { return proxy_->stream_waiting_bytes(); }), 5'000u);
}

TEST_F(ProxyTest, OneStreamTooManyIsClosedAndCounted) {
  start({.most_streams = 2});
  auto first = connect(), second = connect();
  wait_until([&] { return proxy_->stream_count() == 2; });
  auto third = connect();
  std::uint8_t byte = 0;
  boost::system::error_code error;
  asio::read(third, asio::buffer(&byte, 1), error);
  EXPECT_TRUE(error);
  EXPECT_EQ(ask([&] { return network().streams_refused; }), 1u);
  auto served = acceptor_.accept();
  asio::write(first, asio::buffer(&byte, 1));
  asio::read(served, asio::buffer(&byte, 1));
}

TEST_F(ProxyTest, OnePeerTooManyIsNotHeardUntilASilentOneIsForgotten) {
  start({.most_peers = 1, .idle = 200ms});
  auto first = peer(), second = peer();
  udp::endpoint from;
  send(first, 1);
  EXPECT_EQ(receive(from), 1u);
  std::uint32_t sent = 0;
  while (ask([&] { return network().peers == 1; })) {
    send(second, 100 + sent++);
    std::this_thread::sleep_for(5ms);
  }
  const auto heard = receive(from);
  EXPECT_EQ(heard, 100 + ask([&] { return network().datagrams_refused; }));
}

TEST_F(ProxyTest, AResetPassesBehindTheData) {
  start({.down = {.delay = 20ms}});
  auto client = connect();
  auto server = acceptor_.accept();
  const auto sent = pattern(1000);
  asio::write(server, asio::buffer(sent));
  wait_until([&] { return network().down.stream.passed.bytes == sent.size(); });
  server.set_option(asio::socket_base::linger(true, 0));
  server.close();
  Bytes received;
  boost::system::error_code error;
  asio::read(client, asio::dynamic_buffer(received), error);
  EXPECT_TRUE(error);
  EXPECT_NE(error, asio::error::eof);
  wait_until([&] { return proxy_->stream_count() == 0; });
}

TEST_F(ProxyTest, WithoutAServerAStreamIsClosedAndTheProxyLivesOn) {
  start({});
  acceptor_.close();
  datagrams_.close();
  auto datagrams = peer();
  send(datagrams, 1);
  std::uint8_t byte = 0;
  for (int i = 0; i < 3; ++i) {
    auto client = connect();
    boost::system::error_code error;
    asio::read(client, asio::buffer(&byte, 1), error);
    EXPECT_TRUE(error);
  }
  wait_until([&] { return proxy_->stream_count() == 0 && network().streams == 3; });
  wait_until([&] { return network().up.datagrams.passed.packets == 1; });
}

TEST_F(ProxyTest, APortThatIsTakenAndAnUnknownMachineAreNamed) {
  const auto taken = acceptor_.local_endpoint().port();
  const auto refused = Proxy::listen(outside_, {.listen_port = taken});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::ResourceMissing);
  EXPECT_NE(refused.error().message.find("--listen"), std::string::npos);
  const auto nowhere = Proxy::listen(outside_, {.listen_address = "nowhere"});
  ASSERT_FALSE(nowhere);
  EXPECT_EQ(nowhere.error().code, ErrorCode::Usage);
}

}  // namespace
}  // namespace trocar::impair
