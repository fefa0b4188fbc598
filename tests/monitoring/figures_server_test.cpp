// The listener for monitoring is asked over real sockets, also by who asks badly.

#include "server/session/monitoring/figures_server.h"

#include <gtest/gtest.h>

#include <atomic>
#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <thread>

namespace trocar::monitoring {
namespace {

using tcp = asio::ip::tcp;

class Figures : public ::testing::Test {
 protected:
  Figures() {
    auto listening = FiguresServer::listen(
        io_, "127.0.0.1", 0,
        {[this] { return is_ill_ ? "it stands still" : ""; }, [] { return "the session ends"; },
         [] { return "trocar_ticks_total 7\n"; }});
    EXPECT_TRUE(listening.ok());
    server_ = std::move(*listening);
    thread_ = std::thread([this] { io_.run(); });
  }
  ~Figures() override {
    io_.stop();
    thread_.join();
    server_.reset();
  }
  tcp::socket connect() {
    tcp::socket socket(own_);
    socket.connect({asio::ip::make_address("127.0.0.1"), server_->port()});
    return socket;
  }
  // All that is answered until the end.
  static std::string read_all(tcp::socket& socket) {
    std::string answer;
    boost::system::error_code ignored;
    asio::read(socket, asio::dynamic_buffer(answer), ignored);
    return answer;
  }
  std::string ask(const std::string& request) {
    auto socket = connect();
    boost::system::error_code ignored;
    asio::write(socket, asio::buffer(request), ignored);
    return read_all(socket);
  }
  std::string get(const std::string& path) { return ask("GET " + path + " HTTP/1.1\r\n\r\n"); }

  std::atomic<bool> is_ill_{false};
  asio::io_context io_{1}, own_{1};
  std::unique_ptr<FiguresServer> server_;
  std::thread thread_;
};

TEST_F(Figures, HealthReadinessAndFigures) {
  auto answer = get("/healthz");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 ")) << answer;
  EXPECT_TRUE(answer.ends_with("\r\n\r\nok\n")) << answer;
  is_ill_ = true;
  answer = get("/healthz");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 503 ")) << answer;
  EXPECT_TRUE(answer.ends_with("\r\n\r\nit stands still\n")) << answer;
  answer = get("/readyz");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 503 ")) << answer;
  answer = get("/metrics?x=1");
  EXPECT_NE(answer.find("Content-Type: text/plain; version=0.0.4"), std::string::npos) << answer;
  EXPECT_TRUE(answer.ends_with("\r\n\r\ntrocar_ticks_total 7\n")) << answer;
}

TEST_F(Figures, OnlyGetAndOnlyWhatIsThere) {
  EXPECT_TRUE(get("/").starts_with("HTTP/1.1 404 "));
  for (const auto* method : {"POST", "HEAD", "PUT", "DELETE", "OPTIONS"})
    EXPECT_TRUE(ask(std::string(method) + " /metrics HTTP/1.1\r\nContent-Length: 0\r\n\r\n")
                    .starts_with("HTTP/1.1 405 "))
        << method;
}

TEST_F(Figures, NonsenseAndLongHeadsAreNotAnswered) {
  EXPECT_EQ(ask("nonsense\r\n\r\n"), "");
  EXPECT_EQ(ask("GET /metrics HTTP/1.1\r\nX: " +
                std::string(2 * FiguresServer::kMostHeaderBytes, 'x') + "\r\n\r\n"),
            "");
  EXPECT_TRUE(get("/healthz").starts_with("HTTP/1.1 200 ")) << "it goes on";
}

TEST_F(Figures, SocketsThatSayNothingKeepNobodyOut) {
  std::vector<tcp::socket> silent;
  for (int round = 0; round < 10; ++round) {
    for (std::size_t i = 0; i < FiguresServer::kMostConnections; ++i) silent.push_back(connect());
    EXPECT_TRUE(get("/healthz").starts_with("HTTP/1.1 200 ")) << round;
  }
  EXPECT_EQ(read_all(silent.front()), "") << "the oldest has gone";
}

TEST(FiguresServer, ABadOrTakenAddressIsAnError) {
  asio::io_context io;
  const auto bad = FiguresServer::listen(io, "nowhere", 0, {});
  ASSERT_FALSE(bad.ok());
  EXPECT_EQ(bad.error().code, ErrorCode::Usage);
  const auto first = FiguresServer::listen(io, "127.0.0.1", 0, {});
  ASSERT_TRUE(first.ok());
  const auto second = FiguresServer::listen(io, "127.0.0.1", (*first)->port(), {});
  ASSERT_FALSE(second.ok());
  EXPECT_EQ(second.error().code, ErrorCode::ResourceMissing);
}

}  // namespace
}  // namespace trocar::monitoring
