#pragma once

// Keeps what a source of messages brings, and waits for it.

#include <algorithm>
#include <chrono>
#include <functional>
#include <thread>
#include <vector>

#include "client/net/net_source.h"
#include "proto/wire.pb.h"

namespace trocar::testing {

struct Collector final : replica::MessageSink {
  void on_message(const proto::Envelope& message, std::uint64_t, std::size_t) override {
    messages.push_back(message);
  }
  std::size_t count(proto::Envelope::MessageCase kind) const {
    return static_cast<std::size_t>(
        std::count_if(messages.begin(), messages.end(),
                      [kind](const auto& message) { return message.message_case() == kind; }));
  }

  std::vector<proto::Envelope> messages;
};

// Polls until `is_done`; false after 20 s.
inline bool poll_until(net::NetSource& source, Collector& sink,
                       const std::function<bool()>& is_done) {
  for (int i = 0; i < 20'000; ++i) {
    source.poll(sink);
    if (is_done()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return false;
}

}  // namespace trocar::testing
