// A sidecar that speaks Agones' published interface is told what becomes of a session, in the order
// of a game server's life; one that comes late or says no is told again.

#include "server/session/agones/agones.h"

#include <gtest/gtest.h>

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/http/stream.h"
#include "common/intake/acceptor.h"

namespace trocar::agones {
namespace {

using std::chrono::milliseconds;

// A sidecar answers {} to what it is told, and a description of the game server.
constexpr const char* kGameServer =
    R"({"object_meta": {"name": "trocar-x7k2", "namespace": "default",
  "labels": {"islocal": "true"}}, "status": {"state": "Ready", "address": "10.0.0.7",
  "ports": [{"name": "default", "port": 7412}]}})";

// Takes requests on the test's only I/O context.
struct FakeSidecar {
  explicit FakeSidecar(asio::io_context& io) : acceptor(io, {.most = 8}) {}

  std::uint16_t open(std::uint16_t port = 0) {
    EXPECT_TRUE(acceptor.open("127.0.0.1", port, "test").ok());
    acceptor.start([this](auto socket, auto) { return serve(std::move(socket)); });
    return acceptor.port();
  }

  asio::awaitable<void> serve(asio::ip::tcp::socket socket) {
    http::Stream stream(std::move(socket), nullptr);
    http::Request request;
    const auto read = co_await stream.read(request, {.body_bytes = 4096});
    if (read != http::Reading::Whole) co_return;
    const auto what = request.method + " " + request.target;
    if (request.method == "POST") {
      EXPECT_EQ(request.body, "{}");
    }
    EXPECT_EQ(request.field("Content-Type"), "application/json");
    http::Answer answer{.body = what == "GET /gameserver" ? kGameServer : "{}"};
    if (refusals > 0) {
      --refusals;
      answer.status = 500;
    } else {
      told.push_back(what);
    }
    request.keeps_alive = false;
    co_await stream.write(request, answer);
    stream.shut_down();
  }

  intake::Acceptor acceptor;
  std::vector<std::string> told;
  int refusals = 0;
};

class Agones : public ::testing::Test {
 protected:
  void make(std::uint16_t port) {
    sidecar_ = std::make_unique<Sidecar>(
        io_, port, [this] { return ill_; }, [this] { return not_ready_; });
    sidecar_->start();
  }
  // Runs until it has been told that so often, or for too long.
  void run_until(const std::string& what, int times = 1) {
    for (int i = 0; i < 600 && count(what) < times; ++i) io_.run_for(milliseconds(50));
    EXPECT_GE(count(what), times) << what;
  }
  int count(const std::string& what) const {
    return static_cast<int>(std::ranges::count(fake_.told, what));
  }

  asio::io_context io_{1};
  FakeSidecar fake_{io_};
  std::string ill_, not_ready_;
  std::unique_ptr<Sidecar> sidecar_;
};

TEST_F(Agones, IsToldTheLifeOfASession) {
  not_ready_ = "the simulation has not begun";
  make(fake_.open());
  run_until("POST /health");
  EXPECT_EQ(count("POST /ready"), 0) << "nobody may be sent there yet";
  not_ready_.clear();
  run_until("GET /gameserver");
  EXPECT_EQ(count("POST /ready"), 1);
  EXPECT_EQ(count("POST /allocate"), 0);
  sidecar_->set_people(0);
  sidecar_->set_people(1);
  run_until("POST /allocate");
  sidecar_->set_people(2);
  run_until("POST /health", count("POST /health") + 1);
  EXPECT_EQ(count("POST /allocate"), 1) << "once";
  EXPECT_EQ(count("POST /ready"), 1) << "once";
}

TEST_F(Agones, WhoIsIllSaysNothing) {
  make(fake_.open());
  run_until("GET /gameserver");
  ill_ = "the simulation has shown nothing for 11 s";
  run_until("POST /health", 1);
  const auto before = count("POST /health");
  io_.run_for(Sidecar::kHealthPeriod * 2);
  EXPECT_LE(count("POST /health"), before + 1) << "one may have been on its way";
  ill_.clear();
  run_until("POST /health", before + 2);
}

TEST_F(Agones, ASidecarMayComeLateAndSayNoAtFirst) {
  // A port that is free now.
  std::uint16_t port = 0;
  {
    FakeSidecar first(io_);
    port = first.open();
    first.acceptor.stop();
    io_.run_for(milliseconds(50));
    io_.restart();
  }
  make(port);
  io_.run_for(milliseconds(1500));
  EXPECT_TRUE(fake_.told.empty());
  fake_.refusals = 2;
  fake_.open(port);
  run_until("GET /gameserver");
  EXPECT_EQ(fake_.refusals, 0);
  EXPECT_EQ(count("POST /ready"), 1);
}

TEST_F(Agones, ShutdownIsToldWithoutAnIoThread) {
  const auto port = fake_.open();
  std::atomic<bool> is_done{false};
  std::thread session([&] {
    EXPECT_TRUE(shut_down(port).ok());
    is_done = true;
  });
  while (!is_done) io_.run_for(milliseconds(20));
  session.join();
  EXPECT_EQ(fake_.told, std::vector<std::string>{"POST /shutdown"});
}

TEST(AgonesPlace, IsReadAsPublished) {
  const auto place = read_place(kGameServer);
  ASSERT_TRUE(place.ok());
  EXPECT_EQ(place->name, "trocar-x7k2");
  EXPECT_EQ(place->address, "10.0.0.7");
  EXPECT_EQ(place->port, 7412);
  EXPECT_EQ(read_place(R"({"object_meta": {"name": "a\u001bb"}})")->name.find('\x1b'),
            std::string::npos);
  EXPECT_EQ(read_place(R"({"object_meta": {}, "status": {"ports": []}})")->port, 0);
  for (const auto* bad :
       {"", "[]", "{", "{}", R"({"object_meta": 1})", R"({"object_meta": {}, "status": 1})",
        R"({"object_meta": {}, "status": {"ports": 1}})",
        R"({"object_meta": {}, "status": {"ports": [{"port": 70000}]}})",
        R"({"object_meta": {}, "status": {"ports": [{"port": -1}]}})"})
    EXPECT_FALSE(read_place(bad).ok()) << bad;
}

TEST(AgonesPort, IsTheVariablesOrTheDefault) {
  EXPECT_EQ(*sidecar_port(nullptr), kDefaultPort);
  EXPECT_EQ(*sidecar_port("9360"), 9360);
  for (const auto* bad : {"", "0", "65536", "-1", "93x", " 9358"}) {
    const auto port = sidecar_port(bad);
    ASSERT_FALSE(port.ok()) << bad;
    EXPECT_TRUE(port.error().message.starts_with("AGONES_SDK_HTTP_PORT: ")) << port.error().message;
  }
}

}  // namespace
}  // namespace trocar::agones
