#pragma once

// The Haply Inverse Service as far as a client sees it: an inventory on connecting, then one state
// for each message. What it does wrong is chosen before a client comes, or by a reply of the test.

#include "common/base/asio.h"  // before Boost: see there

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace trocar::testing {

class FakeHaply {
 public:
  // Says what to answer to the message with this number, from 0; nothing: no answer. An answer
  // "hang up" ends the connection.
  using Answer = std::function<std::optional<std::string>(int number, const std::string& message)>;

  // Says the inventory to each client that comes, one after another; empty: nothing.
  using Inventory = std::function<std::string()>;

  explicit FakeHaply(std::string inventory, Answer answer = {});
  // on_end: a client's connection has ended.
  FakeHaply(Inventory inventory, Answer answer, std::function<void()> on_end);
  ~FakeHaply();

  std::string url() const;
  std::vector<std::string> messages() const;  // from the client, so far
  int message_count() const { return static_cast<int>(messages().size()); }
  bool was_closed() const { return was_closed_; }  // as the protocol says

  // A state with the device at (x, y, z) of its own frame.
  static std::string state(double x, double y, double z);

 private:
  void serve();
  void serve_client(boost::asio::ip::tcp::socket& socket);

  const Inventory inventory_;
  const Answer answer_;
  const std::function<void()> on_end_;
  boost::asio::io_context context_{1};
  boost::asio::ip::tcp::acceptor acceptor_;
  // The client's socket a second time: the thread may close its own at any moment. -1: none.
  std::atomic<int> client_{-1};
  std::atomic<bool> is_ending_{false};
  mutable std::mutex lock_;
  std::vector<std::string> messages_;
  int number_ = 0;  // of the next message
  std::atomic<bool> was_closed_{false};
  std::thread thread_;
};

}  // namespace trocar::testing
