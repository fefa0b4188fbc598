#pragma once

// One stream through the proxy: two sockets, and a line for each direction. Each line has a
// coroutine that reads and one that writes what departs.
//
// An end of the stream passes in its line like a segment, so data before it arrives and a reset
// shows as late as everything else. When writing fails, what that line holds is thrown away; the
// other direction hears of it from its own socket.
//
// Thread: the one that runs the I/O context.

#include <functional>
#include <memory>

#include "common/impair/network.h"
#include "common/impair/stream_line.h"

namespace trocar::impair {

// For sockets that this direction is read from: what waits unread there waits unseen before the cap
// on the rate, so a slow link gets a small buffer. It must be set before a connection exists.
int receive_buffer_bytes(const Impairment& impairment);

class StreamRelay : public std::enable_shared_from_this<StreamRelay> {
 public:
  StreamRelay(std::shared_ptr<Network> network, asio::ip::tcp::socket client, std::uint64_t number);

  // `closed` is called once, unless close() is.
  void start(std::function<void()> closed);
  void close();
  std::size_t waiting_bytes() const {
    return up_.line.waiting_bytes() + down_.line.waiting_bytes();
  }

 private:
  struct Half {
    Half(Direction& direction, const Network& network, Flow flow, std::uint64_t number,
         asio::ip::tcp::socket& reads, asio::ip::tcp::socket& writes);
    asio::ip::tcp::socket& from;
    asio::ip::tcp::socket& to;
    StreamLine line;
    asio::steady_timer has_arrived, has_departed;  // wake the writer, the reader
    bool is_done = false;                          // nothing more is written
  };

  asio::awaitable<void> connect();
  asio::awaitable<void> read(Half& half);
  asio::awaitable<void> write(Half& half);
  void run(asio::awaitable<void> work);
  void finish();

  const std::shared_ptr<Network> network_;
  asio::ip::tcp::socket client_, server_;
  Half up_, down_;
  std::function<void()> closed_;
  bool is_closed_ = false;
};

}  // namespace trocar::impair
