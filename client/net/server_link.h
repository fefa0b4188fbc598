#pragma once

// The way to a session's server: TCP, TLS, and a look at the certificate before anything is said.
// The session may be found at several addresses: as the options say first, then as its Welcomes do.
// Thread: the Asio thread.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "client/net/net_source.h"
#include "common/secure/stream.h"

namespace trocar::net {

class ServerLink {
 public:
  static constexpr std::size_t kMostAddresses = 9;
  using Clock = std::chrono::steady_clock;
  static constexpr const char* kUnknownName = "no machine is known by this name";
  enum class Outcome { Open, NotYet, Refused };  // NotYet: another try may help

  // `options` outlives this.
  ServerLink(asio::io_context& context, const NetSourceOptions& options);

  // One try at each endpoint of the present address. `comes_back`: to a session that was there, of
  // which more is forgiven. why() says why not; Refused is final.
  asio::awaitable<Outcome> open(Clock::time_point deadline, bool comes_back);
  const std::string& why() const { return why_; }
  void set_why(std::string why) { why_ = std::move(why); }

  secure::Stream& stream() { return *stream_; }
  bool has_tls() const { return stream_ && stream_->has_tls(); }
  // Returns the code whose certificate it must be; nothing: it was not asked for.
  const std::optional<secure::JoinCode>& code() const { return code_; }

  // Keeps one that a Welcome has named; what is no address, or too many, is left out.
  void note_address(const std::string& address);
  void turn_to_next_address() { at_ = (at_ + 1) % addresses_.size(); }
  // Not at the one of the options.
  bool is_elsewhere() const { return at_ > 0; }
  const std::string& host() const { return addresses_[at_].host; }
  // The one of the options, for people.
  std::string name() const;

  // Ends what is under way.
  void cut();
  // And what would follow.
  void end();

 private:
  struct Address {
    std::string host;
    std::uint16_t port = 0;
    bool operator==(const Address&) const = default;
  };

  asio::awaitable<Outcome> secure_stream(bool comes_back);
  Outcome judge(const boost::system::error_code& error, bool comes_back);
  Outcome judge_certificate();

  const NetSourceOptions& options_;
  std::vector<Address> addresses_;
  std::size_t at_ = 0;            // which is, or was last, connected to
  asio::ip::tcp::socket socket_;  // while it connects
  std::optional<secure::Stream> stream_;
  asio::ip::tcp::resolver resolver_;
  std::optional<secure::JoinCode> code_;
  std::string why_;
  bool is_over_ = false;
};

}  // namespace trocar::net
