#pragma once

// One WebSocket to a browser, by Boost.Beast, over the stream on which it was asked for. Messages
// of a browser are bounded, the connection ends when the browser is silent, and nothing is
// compressed: frames hardly get smaller, and each watcher would take its own compressor. Operations
// are awaited on its executor; one read and one write may be under way at the same time. cut() ends
// both.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/awaitable.hpp>
#include <memory>
#include <string>

#include "common/base/bytes.h"
#include "common/http/stream.h"

namespace trocar::http {

struct WebMessage {
  enum class Kind { Text, Binary, Closed, Lost };  // Closed: the page said that it leaves
  Kind kind = Kind::Lost;
  Bytes bytes;
};

class WebSocket {
 public:
  // `stream` is done for. Messages that are read have `most_bytes` at most.
  WebSocket(Stream& stream, std::string peer_address, std::size_t most_bytes);
  ~WebSocket();

  asio::any_io_executor executor();
  // False: it does not come about.
  asio::awaitable<bool> accept(const Request& request);
  // A message over the limit ends the connection: Lost.
  asio::awaitable<WebMessage> read();
  // False: the connection has ended. `bytes` live until it is done.
  asio::awaitable<bool> write(BytesView bytes);
  // Says farewell in order; what is under way ends.
  asio::awaitable<void> close();
  void cut();
  const std::string& peer_address() const { return peer_; }

 private:
  class Below;
  struct Core;

  const std::unique_ptr<Core> core_;
  const std::string peer_;
};

}  // namespace trocar::http
