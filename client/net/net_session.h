#pragma once

// The Asio side of a NetSource. The members under "Render thread" may be called there while the
// thread runs; all others belong to the Asio thread.

#include "common/base/asio.h"  // before Boost: see there

#include <array>
#include <atomic>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <optional>
#include <random>
#include <thread>
#include <vector>

#include "client/net/comeback.h"
#include "client/net/datagram_path.h"
#include "client/net/net_source.h"
#include "common/base/spsc_queue.h"
#include "common/secure/stream.h"
#include "common/wire/framing.h"
#include "common/wire/server_clock.h"
#include "proto/wire.pb.h"

namespace trocar::net {

class NetSource::Session {
 public:
  struct Arrival {
    std::shared_ptr<const proto::Envelope> message;  // null in empty slots
    std::uint64_t arrival_ns = 0;
    std::size_t bytes = 0;
  };

  explicit Session(NetSourceOptions options);
  ~Session();

  // Render thread.
  std::optional<Arrival> try_pop();
  bool try_send(const proto::Envelope& message);
  void request_close(const std::string& reason);
  // After true: everything was pushed, close_reason() does not change any more.
  bool has_ended() const { return has_ended_.load(std::memory_order_acquire); }
  const replica::CloseReason& close_reason() const { return close_reason_; }
  replica::SourceStatistics statistics() const;
  std::string server_name() const;
  bool is_away() const { return comeback_.is_away(); }

 private:
  static constexpr std::size_t kMostReports = 64;  // 4 s of two hands
  using Clock = std::chrono::steady_clock;
  using tcp = asio::ip::tcp;

  asio::awaitable<void> run();
  asio::awaitable<bool> connect();
  asio::awaitable<bool> try_to_connect(Clock::time_point deadline);
  // Until a connection is there again; false: it never will.
  asio::awaitable<bool> come_back();
  asio::awaitable<void> await_conversation_end();
  asio::awaitable<bool> secure_stream();
  void end_insecure(const boost::system::error_code& error);
  bool accept_server();
  asio::awaitable<void> read_messages();
  asio::awaitable<bool> read_exactly(std::uint8_t* to, std::size_t count);
  asio::awaitable<void> deliver(std::shared_ptr<const proto::Envelope> message, std::size_t bytes);
  asio::awaitable<void> write_messages();
  asio::awaitable<void> ping();
  asio::awaitable<void> expire(Clock::time_point deadline);

  void end_if_failed(const std::exception_ptr& failure);
  void begin_conversation();
  bool try_push(Arrival arrival);
  bool is_talking() const { return is_connected_ && !is_done_; }
  // The connection is no good any more.
  void break_connection(std::string why);
  void note_welcome(const proto::Welcome& welcome);
  void note_place(const std::string& address);
  // The server closed before it answered: when many come at once it makes room for others.
  bool may_try_again() const;
  bool may_come_back() const { return comeback_.is_allowed() && !is_closing_ && !is_done_; }
  bool make_room_for(std::span<const std::uint8_t, wire::kHeaderBytes> header);
  std::shared_ptr<const proto::Envelope> pop_message();
  void end_if_final(const proto::Envelope& message);
  void heed(const proto::Envelope& message);
  void note_pong(const proto::Pong& pong);
  void begin_datagrams();
  void deliver_datagram(std::shared_ptr<const proto::Envelope> message, std::size_t bytes);
  void take_outbound();
  void take_priority();
  void pass_on_to_hands(const proto::Envelope& message);
  asio::awaitable<void> serve_hands();
  void take_readings();
  void take_reports();
  void take_from_hands();
  void end_after_stream();
  void end_absence();
  void say_waiting(const std::string& why) const;
  void end_unreachable(const std::string& why);
  void check_silence();
  void queue_ping();
  void begin_close(const std::string& reason);
  void end(replica::CloseKind kind, std::string text);  // the first one counts
  void stop_io();
  wire::SharedBytes encode_hello() const;

  // The session may be found there: as the options say first, then as its Welcomes do.
  struct Place {
    std::string host;
    std::uint16_t port = 0;
    bool operator==(const Place&) const = default;
  };
  static constexpr std::size_t kMostPlaces = 9;

  const NetSourceOptions options_;
  std::vector<Place> places_;
  std::size_t place_ = 0;  // that is, or was last, connected to
  asio::io_context context_{1};
  tcp::socket socket_{context_};  // while it connects
  std::optional<secure::Stream> stream_;
  std::string why_not_;                   // there is no connection yet
  std::optional<secure::JoinCode> code_;  // whose certificate it must be, and what Hello sends
  Comeback comeback_;
  std::string why_broken_;  // the connection
  int talkers_ = 0;         // coroutines of this connection besides the reader
  tcp::resolver resolver_{context_};
  asio::steady_timer retry_timer_{context_}, room_timer_{context_}, ping_timer_{context_};
  asio::steady_timer wake_timer_{context_}, deadline_timer_{context_}, hands_timer_{context_};
  std::vector<wire::SharedBytes> control_;                 // Hello, Ping, Bye: at most one of each
  std::array<wire::SharedBytes, kToolsPerHand> readings_;  // for the stream, by tool; null: none
  std::vector<wire::SharedBytes> reports_;                 // likewise, at most kMostReports
  std::uint32_t reading_sequence_ = 0;
  std::vector<wire::SharedBytes> in_flight_;
  std::unique_ptr<DatagramPath> datagrams_;  // null: the stream carries everything
  wire::ServerClock clock_;
  bool is_connected_ = false, is_closing_ = false, is_done_ = false, is_stalled_ = false;
  bool is_barrier_ = false;  // answers must arrive from here on
  bool has_heard_ = false;   // of this connection
  bool is_ping_queued_ = false;
  Clock::time_point last_heard_{}, last_datagram_{};
  Clock::time_point connect_until_{};  // the first connection
  std::minstd_rand random_{std::random_device{}()};
  Bytes body_;

  SpscQueue<Arrival> inbound_;
  std::atomic<std::size_t> inbound_bytes_{0};  // in it, as they came
  SpscQueue<std::shared_ptr<const proto::Envelope>> outbound_;
  std::atomic<bool> is_wake_posted_{false};
  std::atomic<bool> has_ended_{false};
  replica::CloseReason close_reason_;  // written before has_ended_ is set
  std::atomic<std::uint64_t> bytes_received_{0}, bytes_sent_{0}, messages_received_{0};
  std::atomic<std::uint64_t> frames_received_{0}, sends_dropped_{0};
  std::atomic<std::uint64_t> datagram_bytes_received_{0}, datagram_bytes_sent_{0};
  std::atomic<std::uint64_t> datagrams_received_{0}, datagrams_lost_{0};
  std::atomic<std::uint64_t> slices_received_{0}, hand_messages_refused_{0};
  std::atomic<double> round_trip_seconds_{0}, shortest_round_trip_seconds_{0};
  std::atomic<double> server_offset_us_{0};
  std::atomic<bool> has_server_clock_{false};
  std::thread thread_;
};

}  // namespace trocar::net
