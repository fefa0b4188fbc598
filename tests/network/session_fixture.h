#pragma once

// A live session on 127.0.0.1 without a simulation: real sockets, the real TcpServer and Replicator
// on an I/O thread, and frames that a test makes and publishes when it wants to. So nothing depends
// on the clock, and a test says exactly how many frames pass while a client does not read.

#include "common/base/asio.h"  // before Boost: see there

#include <gtest/gtest.h>

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <future>
#include <optional>
#include <random>
#include <thread>

#include "common/wire/surface_codec.h"
#include "common/wire/surface_layout.h"
#include "proto/wire.pb.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/session/net/tcp_server.h"
#include "server/session/participants/inbox.h"
#include "server/session/replication/replicator.h"
#include "server/watch/crowd/guest_connections.h"
#include "tests/support/random.h"

namespace trocar::testing {

// A client made of blocking socket calls, which can also misbehave.
class RawClient {
 public:
  // `receive_buffer_bytes`: small, for a reader that is to block its server soon.
  explicit RawClient(std::uint16_t port, int receive_buffer_bytes = 0);
  ~RawClient();
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  // False when the peer has closed.
  bool send_bytes(BytesView bytes);
  bool send(const proto::Envelope& envelope);
  void shut_down_sending();
  // True if the peer has closed; takes nothing and does not wait.
  bool is_closed() const;
  // Next message; nothing at the end of the stream or after 10 s.
  std::optional<proto::Envelope> receive();
  // Skips messages until one of this kind.
  std::optional<proto::Envelope> receive(proto::Envelope::MessageCase kind);
  // Reads to the end and returns the Goodbye in it, if any.
  std::optional<proto::Goodbye> read_goodbye();
  // True if the stream ends (everything in it is skipped).
  bool reads_to_end();

  // Says Hello and reads up to Welcome.
  bool join(const std::string& name, proto::Role role);
  // The same as a client that can come back, with a token of before or without; returns Welcome.
  std::optional<proto::Welcome> join_to_return(const std::string& name, proto::Role role,
                                               const std::string& token = {});

  // The client shows this; follow() keeps it up to date.
  wire::QuantisedSurface surface;
  std::optional<wire::SurfaceLayout> layout;  // from the first topology that follow() met
  int topologies = 0, changes = 0;
  std::uint32_t frame = 0;
  std::uint32_t last_base = 0;  // of the last delta
  bool last_was_keyframe = false;
  int frames_followed = 0;
  enum class Expect { RightCrc, WrongCrc };
  // Reads up to the next SurfaceFrame and applies it, with the topology and changes before it;
  // fails the test on a wrong baseline or epoch, or a CRC that is not as expected.
  bool follow(Expect expect = Expect::RightCrc);

 private:
  void take_layout_message(const proto::Envelope& message);
  bool receive_exactly(std::uint8_t* to, std::size_t count);

  int socket_ = -1;
};

proto::Envelope make_hello(const std::string& name, proto::Role role);
proto::Envelope make_sample(std::uint32_t sequence);

class LiveSession {
 public:
  explicit LiveSession(net::TcpServerOptions tcp = {}, replication::ReplicatorOptions options = {},
                       catalogue::LatticeSize size = {8, 5, 8, 0.01}, std::uint16_t port = 0);
  ~LiveSession();

  std::uint16_t port() const { return port_; }
  const wire::SurfaceLayout& layout() const { return layout_; }  // of the last frame made

  // Runs `call` on the I/O thread and waits for it.
  template <typename Call>
  auto on_io(Call call) {
    using Value = decltype(call());
    std::packaged_task<Value()> task(std::move(call));
    auto result = task.get_future();
    asio::post(io_, [&task] { task(); });
    return result.get();
  }

  // Publishes the next frame: the last surface with `changes` vertices moved.
  step::SharedFrame publish(std::size_t changes, std::vector<hands::ClaimEvent> events = {});
  // Makes the next frame without publishing it; `is_cut`: with a change of the surface.
  step::SharedFrame make_frame(std::size_t changes, bool is_cut = false);
  void publish_all(const std::vector<step::SharedFrame>& frames);
  std::size_t sessions();
  // Waits until there are this many connections (joined or not); false after 10 s.
  bool wait_for_sessions(std::size_t count);

  participants::SimulationInbox inbox;
  net::TcpServer& tcp() { return *tcp_; }                         // inside on_io
  replication::Replicator& replicator() { return *replicator_; }  // inside on_io

 private:
  organ::Organ organ_;
  wire::SurfaceLayout layout_;
  asio::io_context io_{1};
  asio::executor_work_guard<asio::io_context::executor_type> work_{io_.get_executor()};
  std::unique_ptr<net::TcpServer> tcp_;
  std::unique_ptr<crowd::GuestConnections> connections_;
  std::unique_ptr<replication::Replicator> replicator_;
  std::uint16_t port_ = 0;
  std::mt19937 random_{7};
  Random cuts_{7};
  wire::QuantisedSurface surface_;
  Frame frame_ = 0;
  std::thread thread_;
};

}  // namespace trocar::testing
