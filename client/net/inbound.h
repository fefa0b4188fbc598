#pragma once

// Messages on their way from the Asio thread to the render thread: so many at most, and so many
// bytes as they came. One message fits whatever its size, as long as nothing else waits.

#include <atomic>
#include <memory>
#include <optional>

#include "common/base/spsc_queue.h"
#include "proto/wire.pb.h"

namespace trocar::net {

struct Arrival {
  std::shared_ptr<const proto::Envelope> message;  // null in empty slots
  std::uint64_t arrival_ns = 0;
  std::size_t bytes = 0;
};

class Inbound {
 public:
  Inbound(std::size_t most_messages, std::size_t most_bytes)
      : queue_(most_messages), most_bytes_(most_bytes) {}

  // Asio thread. False: there is no room.
  bool try_push(Arrival arrival) {
    const auto bytes = arrival.bytes;
    const auto waiting = bytes_.load();
    if (waiting > 0 && waiting + bytes > most_bytes_) return false;
    bytes_ += bytes;
    const bool is_pushed = queue_.try_push(std::move(arrival));
    if (!is_pushed) bytes_ -= bytes;
    return is_pushed;
  }

  // Render thread.
  std::optional<Arrival> try_pop() {
    auto arrival = queue_.try_pop();
    if (arrival) bytes_ -= arrival->bytes;
    return arrival;
  }

 private:
  SpscQueue<Arrival> queue_;
  const std::size_t most_bytes_;
  std::atomic<std::size_t> bytes_{0};
};

}  // namespace trocar::net
