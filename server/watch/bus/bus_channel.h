#pragma once

// A Channel over NATS. What comes waits for the executor's thread, kMostWaitingBytes of it; what
// goes out waits for a thread of its own, likewise, because a bus may wait for its socket. At the
// end that thread has a second to send what is left.
// Thread: that of the executor.

#include "common/base/asio.h"  // before Boost: see there

#include <atomic>
#include <boost/asio/any_io_executor.hpp>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "server/bus/bus.h"
#include "server/watch/bus/channel.h"

namespace trocar::bus {

class BusChannel final : public Channel {
 public:
  static constexpr std::size_t kMostWaitingBytes = 64 * 1024 * 1024;
  static constexpr std::size_t kMessageCostBytes = 256;  // of one that waits, beside its content

  // Returns what a message that waits counts, in bytes.
  static std::size_t cost(std::string_view subject, std::size_t bytes, std::string_view answer_to) {
    return kMessageCostBytes + subject.size() + bytes + answer_to.size();
  }

  BusChannel(asio::any_io_executor executor, std::unique_ptr<Bus> bus);
  ~BusChannel() override;

  Status listen(const std::string& subject, Take take) override;
  void send(const std::string& subject, Bytes bytes, const std::string& answer_to) override;
  std::size_t waiting_bytes() const override { return waiting_out_; }
  std::size_t most_bytes() const override { return bus_->most_bytes(); }

 private:
  struct Letter {
    std::string subject, text, answer_to;
  };
  void send_all(const std::stop_token& stop);

  asio::any_io_executor executor_;
  std::vector<std::shared_ptr<Take>> takes_;  // the bus has them as weak pointers
  const std::shared_ptr<std::atomic<std::size_t>> waiting_in_ =
      std::make_shared<std::atomic<std::size_t>>(0);
  std::mutex lock_;  // of the letters
  std::condition_variable_any has_letter_;
  std::deque<Letter> letters_;
  std::atomic<std::size_t> waiting_out_ = 0;
  std::unique_ptr<Bus> bus_;
  std::jthread sender_;
};

}  // namespace trocar::bus
