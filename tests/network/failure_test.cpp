// An exception in a handler or coroutine of the network thread is not swallowed.

#include "tests/network/session_fixture.h"

namespace trocar::testing {
namespace {

struct ThrowingHandler final : net::ConnectionHandler {
  void on_open(net::ConnectionId) override {}
  void on_message(net::ConnectionId, BytesView) override {
    throw std::runtime_error("a message too many");
  }
  void on_datagram(net::ConnectionId, BytesView) override {}
  void on_fault(net::ConnectionId, net::ConnectionFault) override {}
  void on_close(net::ConnectionId) override {}
};

TEST(Failure, an_exception_while_a_message_is_handled_ends_the_network_thread_with_a_reason) {
  asio::io_context io{1};
  ThrowingHandler handler;
  auto listening = net::TcpServer::listen(io, {.port = 0});
  ASSERT_TRUE(listening.ok());
  (*listening)->start(handler);
  auto ended = std::async(std::launch::async, [&io] { return net::run(io); });
  RawClient client((*listening)->port());
  ASSERT_TRUE(client.send(make_hello("Anna", proto::ROLE_SURGEON)));
  ASSERT_EQ(ended.wait_for(std::chrono::seconds(10)), std::future_status::ready)
      << "it was swallowed";
  const Status said = ended.get();
  ASSERT_FALSE(said.ok());
  EXPECT_NE(said.error().message.find("a message too many"), std::string::npos)
      << said.error().message;
  EXPECT_EQ(said.error().message.find('\n'), std::string::npos);
}

TEST(Failure, without_an_exception_nothing_is_said) {
  asio::io_context io{1};
  asio::post(io, [] {});
  EXPECT_TRUE(net::run(io).ok());
}

}  // namespace
}  // namespace trocar::testing
