#pragma once

// Takes connections at one address, with one policy: of the session's port, of trocar-hall, of the
// page and of figures. There are so many at most, in all and of each address, and fewer of those
// who have not said anything yet. For one more who finds no room the oldest of the silent is cut:
// of the same address where that is full, else of the address that has most of them. Who means it
// has spoken within milliseconds; who has not after `time_to_speak` is cut, too.
//
// Thread: the one that runs the I/O context.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "common/base/result.h"

namespace trocar::intake {

// Whether it is an IPv4 or IPv6 address; ErrorCode::Usage if not. `named`: the option or key that
// said so.
Status check_address(const std::string& address, const std::string& named);

struct Limits {
  int most = 0, most_per_address = most;  // connections
  int most_silent = most, most_silent_per_address = most_per_address;
  std::chrono::milliseconds time_to_speak{5000};
};

struct Counters {
  std::uint64_t accepted = 0;
  std::uint64_t refused = 0;  // closed at once: nobody could be cut for it
  std::uint64_t cut = 0;      // silent ones, for others
};

class Acceptor {
  struct State;

 public:
  enum class Cut { NoRoom, Late, End };

  // Somebody who is connected, as long as this lives; silent at first.
  class Peer {
   public:
    Peer(std::shared_ptr<State> state, std::string address);
    ~Peer();
    Peer(const Peer&) = delete;
    Peer& operator=(const Peer&) = delete;

    const std::string& address() const { return address_; }
    // `cut` closes the connection, and may end this.
    void set_cut(std::function<void(Cut)> cut) { cut_ = std::move(cut); }
    // It has done something, if little: others are cut before it. Its time goes on.
    void show_life();
    void speak();
    // It may be silent again, for as long.
    void fall_silent();

   private:
    friend struct State;

    const std::shared_ptr<State> state_;
    const std::string address_;
    const std::uint64_t id_;
    std::uint64_t silent_since_ = 0;  // a number in order; 0: it has spoken
    std::chrono::steady_clock::time_point deadline_;
    std::function<void(Cut)> cut_;
  };
  // It lives, with what it holds, until all are served.
  using Serve = std::function<asio::awaitable<void>(asio::ip::tcp::socket, std::unique_ptr<Peer>)>;

  Acceptor(asio::io_context& context, const Limits& limits);
  ~Acceptor() { stop(); }

  // Binds and listens. `named`: as above. ErrorCode::ResourceMissing when the address cannot be
  // had. Port 0: any free one.
  Status open(const std::string& address, std::uint16_t port, const std::string& named);
  void start(Serve serve);
  // No further connections; those that are there go on.
  void stop();
  void cut_all();

  std::uint16_t port() const;
  bool is_stopping() const;
  int count() const;  // of connections
  const Counters& counters() const;

 private:
  std::shared_ptr<State> state_;
};

}  // namespace trocar::intake
