#pragma once

// The part of a small HTTP server that takes connections: so many at once at most, each served by a
// coroutine. Where all are taken, the oldest that has not asked for anything yet is closed, of the
// address that has most of these: who means it has asked within milliseconds.
//
// Thread: the one that runs the I/O context.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "common/base/result.h"

namespace trocar::monitoring {

class HttpAcceptor {
 public:
  using Serve = std::function<asio::awaitable<void>(asio::ip::tcp::socket)>;

  // Somebody who has not asked yet, as long as this object lives. `cut` ends the connection.
  class Newcomer {
   public:
    Newcomer(HttpAcceptor& acceptor, std::string address, std::function<void()> cut);
    ~Newcomer() { acceptor_.newcomers_.erase(id_); }
    Newcomer(const Newcomer&) = delete;
    Newcomer& operator=(const Newcomer&) = delete;

   private:
    HttpAcceptor& acceptor_;
    const std::uint64_t id_;
  };

  HttpAcceptor(asio::io_context& context, std::size_t most_connections)
      : context_(context), acceptor_(context), most_connections_(most_connections) {}

  // Binds and listens. `named`: the option or key that said so, for errors: ErrorCode::Usage for
  // what is no address, ErrorCode::ResourceMissing when it cannot be had. Port 0: any free one.
  Status open(const std::string& address, std::uint16_t port, const std::string& named);
  // Takes connections until stop(). `owner` holds this object, and lives as long as they do.
  void start(Serve serve, const std::shared_ptr<void>& owner);

  asio::io_context& context() const { return context_; }
  std::uint16_t port() const;
  bool is_stopping() const { return is_stopping_; }
  // No further connections; those that are open go on.
  void stop();

 private:
  struct Waiting {
    std::string address;
    std::function<void()> cut;
  };

  // False: nobody can be closed.
  bool make_room();
  asio::awaitable<void> accept(Serve serve, std::shared_ptr<void> owner);

  asio::io_context& context_;
  asio::ip::tcp::acceptor acceptor_;
  const std::size_t most_connections_;
  std::size_t open_ = 0;
  std::uint64_t next_id_ = 0;
  std::map<std::uint64_t, Waiting> newcomers_;  // the oldest first
  bool is_stopping_ = false;
};

// Whether it is an IPv4 or IPv6 address; ErrorCode::Usage if not. `named`: as in open().
Status check_address(const std::string& address, const std::string& named);

}  // namespace trocar::monitoring
