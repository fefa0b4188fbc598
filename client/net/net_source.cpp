#include "client/net/net_source.h"

#include <charconv>

#include "client/net/net_session.h"

namespace trocar::net {

Status parse_server_address(const std::string& text, NetSourceOptions& options) {
  const auto bad = [&text] {
    return Error{ErrorCode::Usage, "'" + text +
                                       "' is not HOST, HOST:PORT or [IPV6]:PORT: try "
                                       "127.0.0.1:7690"};
  };
  std::string host = text, port;
  if (text.starts_with('[')) {
    const auto end = text.find(']');
    if (end == std::string::npos) return bad();
    host = text.substr(1, end - 1);
    port = text.substr(end + 1);
    if (!port.empty() && port.front() != ':') return bad();
    if (port == ":") return bad();
    if (!port.empty()) port.erase(0, 1);
  } else if (const auto colon = text.find(':'); colon != std::string::npos) {
    if (text.find(':', colon + 1) == std::string::npos) {  // two colons: an IPv6 address
      host = text.substr(0, colon);
      port = text.substr(colon + 1);
      if (port.empty()) return bad();
    }
  }
  if (host.empty()) return bad();
  if (!port.empty()) {
    std::uint16_t number = 0;
    const auto* end = port.data() + port.size();
    const auto parsed = std::from_chars(port.data(), end, number);
    if (parsed.ec != std::errc{} || parsed.ptr != end || number == 0) return bad();
    options.port = number;
  }
  options.host = std::move(host);
  return {};
}

NetSource::NetSource(NetSourceOptions options)
    : session_(std::make_unique<Session>(std::move(options))) {}

NetSource::~NetSource() {
  session_->request_close("client ends");
}

void NetSource::poll(replica::MessageSink& sink) {
  // Asked before the queue is emptied: what ended before had pushed everything before.
  const bool has_ended = session_->has_ended();
  while (const auto arrival = session_->try_pop()) {
    if (arrival->message->has_welcome()) state_ = replica::SourceState::Live;
    sink.on_message(*arrival->message, arrival->arrival_ns, arrival->bytes);
  }
  // Asked after the queue was emptied: the Welcome that ends this absence is still to be pushed.
  if (session_->is_away() && state_ == replica::SourceState::Live)
    state_ = replica::SourceState::Away;
  if (has_ended) state_ = replica::SourceState::Closed;
}

bool NetSource::send(const proto::Envelope& message) {
  if (state_ != replica::SourceState::Live) return false;
  return session_->try_send(message);
}

void NetSource::close(const std::string& reason) {
  session_->request_close(reason);
}

replica::SourceState NetSource::state() const {
  return state_;
}

replica::CloseReason NetSource::close_reason() const {
  return state_ == replica::SourceState::Closed ? session_->close_reason() : replica::CloseReason{};
}

replica::SourceStatistics NetSource::statistics() const {
  return session_->statistics();
}
std::string NetSource::name() const {
  return session_->server_name();
}

}  // namespace trocar::net
