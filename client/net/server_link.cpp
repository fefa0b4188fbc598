#include "client/net/server_link.h"

#include <algorithm>

#include "common/secure/certificate.h"

namespace trocar::net {

using tcp = asio::ip::tcp;

ServerLink::ServerLink(asio::io_context& context, const NetSourceOptions& options)
    : options_(options),
      addresses_{{options.host, options.port}},
      socket_(context),
      resolver_(context) {}

std::string ServerLink::name() const {
  const bool is_ipv6 = options_.host.find(':') != std::string::npos;
  return (is_ipv6 ? "[" + options_.host + "]" : options_.host) + ":" +
         std::to_string(options_.port);
}

void ServerLink::note_address(const std::string& text) {
  NetSourceOptions read;
  if (addresses_.size() >= kMostAddresses || !parse_server_address(text, read).ok()) return;
  const Address address{read.host, read.port};
  if (std::ranges::find(addresses_, address) == addresses_.end()) addresses_.push_back(address);
}

void ServerLink::cut() {
  boost::system::error_code ignored;
  socket_.close(ignored);
  if (stream_) stream_->socket().close(ignored);
  resolver_.cancel();
}

void ServerLink::end() {
  is_over_ = true;
  cut();
}

// Coroutines here hold no temporaries across a co_await and leave the text to plain functions:
// GCC 12 miscompiles some of them otherwise (seen as a trap on resuming).
asio::awaitable<ServerLink::Outcome> ServerLink::open(Clock::time_point deadline, bool comes_back) {
  const auto address = addresses_[at_];
  const auto port = std::to_string(address.port);
  const auto [unresolved, endpoints] =
      co_await resolver_.async_resolve(address.host, port, kNoThrow);
  if (unresolved) why_ = kUnknownName;
  for (const auto& endpoint : endpoints) {
    if (is_over_ || Clock::now() >= deadline) break;
    boost::system::error_code ignored;
    socket_.close(ignored);
    const auto [error] = co_await socket_.async_connect(endpoint, kNoThrow);
    if (error && error != asio::error::operation_aborted) why_ = error.message();
    if (error) continue;
    socket_.set_option(tcp::no_delay(true), ignored);
    stream_.emplace(std::move(socket_), options_.tls);
    const auto outcome = co_await secure_stream(comes_back);
    if (is_over_) break;
    if (outcome != Outcome::NotYet) co_return outcome;
  }
  co_return Outcome::NotYet;
}

asio::awaitable<ServerLink::Outcome> ServerLink::secure_stream(bool comes_back) {
  if (!stream_->has_tls()) co_return Outcome::Open;
  const auto error = co_await stream_->begin_tls(host());
  if (is_over_) co_return Outcome::NotYet;
  if (error) co_return judge(error, comes_back);
  co_return judge_certificate();
}

ServerLink::Outcome ServerLink::judge(const boost::system::error_code& error, bool comes_back) {
  if (error == asio::error::operation_aborted) return Outcome::NotYet;  // the deadline says so
  if (secure::may_try_again(error) || comes_back) {
    why_ = "it closed the connection before TLS was there";
    return Outcome::NotYet;
  }
  why_ = name() + ": " + secure::describe_handshake_failure(error);
  return Outcome::Refused;
}

// Nothing has been sent yet: a server that is not the right one learns neither name nor secret.
ServerLink::Outcome ServerLink::judge_certificate() {
  if (!options_.join_code) return Outcome::Open;
  if (!code_) {
    const auto code = options_.join_code();
    if (!code) {
      why_ = code.error().message;
      return Outcome::Refused;
    }
    code_ = *code;
  }
  if (options_.trusts_ca ||
      secure::code_of_certificate(stream_->peer_certificate_der()) == code_->certificate)
    return Outcome::Open;
  if (is_elsewhere()) {
    why_ = host() + " shows another certificate";
    return Outcome::NotYet;
  }
  why_ = name() +
         " is not the server of this join code, its certificate is another: nothing was sent; "
         "check the code's first eight characters and the address";
  return Outcome::Refused;
}

}  // namespace trocar::net
