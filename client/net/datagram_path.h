#pragma once

// The client's end of a session's datagrams: a UDP socket, DTLS with the key of the session's TLS,
// and what is said over it. Readings of tools are repeated twice, so that a lost datagram costs
// nothing but time.
//
//   Shaking --handshake done--> Open --nothing heard for 2 s--> again, with a new socket
//      ^---failed, or 3 s over: again after a pause that grows to 5 s---|
//
// So a path that was blocked is found again, and a changed address proves itself anew. The path is
// fresh while frames come by it; only then the stream is spared.
//
// Thread: the one that runs the I/O context.

#include "common/base/asio.h"  // before Boost: see there

#include <array>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <deque>
#include <functional>
#include <memory>

#include "client/net/datagram_loss.h"
#include "common/base/ids.h"
#include "common/secure/datagram_channel.h"
#include "proto/wire.pb.h"

namespace trocar::net {

class DatagramPath {
 public:
  // Gets each message that decodes, except probes, and its size.
  using Deliver = std::function<void(std::shared_ptr<const proto::Envelope>, std::size_t)>;
  using Clock = std::chrono::steady_clock;

  DatagramPath(asio::io_context& context, asio::ip::udp::endpoint server, secure::DatagramKey key,
               Deliver deliver);
  ~DatagramPath();

  // Takes a ToolSample or FrameAck; true: it is on its way, so the stream need not carry it.
  bool carry(const proto::Envelope& message);
  bool is_fresh() const;
  std::uint64_t bytes_received() const { return bytes_received_; }
  std::uint64_t bytes_sent() const { return bytes_sent_; }
  const DatagramLoss& loss() const { return loss_; }

 private:
  struct Try;  // one socket and its handshake

  asio::awaitable<void> tend(std::shared_ptr<bool> is_alive);
  asio::awaitable<void> receive(std::shared_ptr<Try> current, std::shared_ptr<bool> is_alive);
  void begin_try();
  void end_try();
  void tend_try(Clock::time_point now);
  void take(BytesView message);
  void send();

  asio::io_context& context_;
  const asio::ip::udp::endpoint server_;
  const secure::DatagramKey key_;
  const Deliver deliver_;
  asio::steady_timer timer_;
  std::shared_ptr<Try> try_;  // null while it pauses
  Clock::time_point next_try_{};
  std::chrono::milliseconds pause_;
  Clock::time_point last_heard_{}, last_frame_{}, last_sent_{};
  std::array<std::deque<proto::ToolSample>, kToolsPerHand> samples_;  // the last three of each tool
  proto::FrameAck ack_;                                               // frame 0: none yet
  bool has_ack_ = false;
  std::uint32_t received_ = 0;
  DatagramLoss loss_;
  std::uint64_t bytes_received_ = 0, bytes_sent_ = 0;
  std::shared_ptr<bool> is_alive_ = std::make_shared<bool>(true);
};

}  // namespace trocar::net
