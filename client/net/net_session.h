#pragma once

// The Asio side of a NetSource: one conversation with the server after the other, until it is over.
// The members under "Render thread" may be called there while the thread runs; all others belong
// to the Asio thread.

#include "common/base/asio.h"  // before Boost: see there

#include <atomic>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <random>
#include <thread>

#include "client/net/conversation.h"

namespace trocar::net {

class NetSource::Session {
 public:
  explicit Session(NetSourceOptions options);
  ~Session();

  // Render thread.
  std::optional<Arrival> try_pop() { return inbound_.try_pop(); }
  bool try_send(const proto::Envelope& message);
  void request_close(const std::string& reason);
  // After true: everything was pushed, close_reason() does not change any more.
  bool has_ended() const { return has_ended_.load(std::memory_order_acquire); }
  const replica::CloseReason& close_reason() const { return close_reason_; }
  replica::SourceStatistics statistics() const { return figures_.statistics(comeback_); }
  std::string server_name() const { return link_.name(); }
  bool is_away() const { return comeback_.is_away(); }

 private:
  using Clock = std::chrono::steady_clock;

  asio::awaitable<void> run();
  asio::awaitable<bool> connect();
  // Until a connection is there again; false: it never will.
  asio::awaitable<bool> come_back();
  // False: the session has ended, or another try may help.
  asio::awaitable<bool> try_to_connect(Clock::time_point deadline);
  asio::awaitable<void> expire(Clock::time_point deadline);
  void begin_expiring(Clock::time_point deadline);

  ConversationEvents events();
  void break_connection(std::string why);
  void note_welcome(const proto::Welcome& welcome);
  // The server closed before it answered: when many come at once it makes room for others.
  bool may_try_again() const;
  bool may_come_back() const;
  void begin_close(const std::string& reason);
  void end_if_failed(const std::exception_ptr& failure);
  void end(replica::CloseKind kind, std::string text);  // the first one counts
  void stop_io();

  const NetSourceOptions options_;
  asio::io_context context_{1};
  ServerLink link_;
  Comeback comeback_;
  std::string why_broken_;  // the connection
  asio::steady_timer retry_timer_{context_}, deadline_timer_{context_};
  Clock::time_point connect_until_{};  // the first connection
  std::minstd_rand random_{std::random_device{}()};
  bool is_done_ = false;

  Inbound inbound_;
  SpscQueue<std::shared_ptr<const proto::Envelope>> outbound_;
  NetFigures figures_;
  Conversation conversation_;
  std::atomic<bool> is_wake_posted_{false};
  std::atomic<bool> has_ended_{false};
  replica::CloseReason close_reason_;  // written before has_ended_ is set
  std::thread thread_;
};

}  // namespace trocar::net
