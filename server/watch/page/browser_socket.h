#pragma once

// One WebSocket to a browser, as the bridge sees it. Operations are awaited on its executor; one
// read and one write may be under way at the same time. cut() ends both.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/awaitable.hpp>
#include <string>

#include "common/base/bytes.h"

namespace trocar::page {

struct BrowserMessage {
  enum class Kind { Text, Binary, Closed, Lost };  // Closed: the page said that it leaves
  Kind kind = Kind::Lost;
  Bytes bytes;
};

class BrowserSocket {
 public:
  virtual ~BrowserSocket() = default;
  virtual asio::any_io_executor executor() = 0;
  // A message over the limit ends the connection: Lost.
  virtual asio::awaitable<BrowserMessage> read() = 0;
  // False: the connection has ended. `bytes` live until it is done.
  virtual asio::awaitable<bool> write(BytesView bytes) = 0;
  // Says farewell in order; what is under way ends.
  virtual asio::awaitable<void> close() = 0;
  virtual void cut() = 0;
  virtual std::string peer_address() const = 0;
};

}  // namespace trocar::page
