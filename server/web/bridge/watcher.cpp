#include "server/web/bridge/watcher.h"

#include <algorithm>
#include <array>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <cstring>

#include "common/base/log.h"
#include "common/base/printable.h"
#include "common/base/timing.h"
#include "common/secure/certificate.h"
#include "proto/wire.pb.h"

namespace trocar::bridge {
namespace {

using tcp = asio::ip::tcp;

constexpr std::chrono::seconds kJoinDeadline{5}, kReachDeadline{5};
constexpr std::size_t kMostKnownCertificates = 64;
// Small, so that old frames wait at the session, which leaves them out, and not on the way.
constexpr int kReceiveBytes = 64 * 1024;

}  // namespace

Bridge::Bridge(std::vector<SessionAddress> sessions)
    : sessions_(std::move(sessions)), tls_(secure::make_client_context()) {}

const SessionAddress* Bridge::find_session(const std::string& name) const {
  if (name.empty() && !sessions_.empty()) return &sessions_.front();
  const auto found = std::ranges::find(sessions_, name, &SessionAddress::name);
  return found == sessions_.end() ? nullptr : &*found;
}

secure::HalfCode Bridge::code_of(BytesView der) {
  Bytes key(der.begin(), der.end());
  if (const auto known = known_.find(key); known != known_.end()) return known->second;
  if (known_.size() >= kMostKnownCertificates) known_.clear();
  return known_.emplace(std::move(key), secure::code_of_certificate(der)).first->second;
}

Watcher::Watcher(std::unique_ptr<BrowserSocket> browser, Bridge& bridge)
    : browser_(std::move(browser)),
      bridge_(bridge),
      deadline_(browser_->executor()),
      up_ended_(browser_->executor(), asio::steady_timer::time_point::max()) {}

void Watcher::cut() {
  is_cut_ = true;
  browser_->cut();
  boost::system::error_code ignored;
  if (session_) session_->socket().close(ignored);
  deadline_.cancel();
}

asio::awaitable<void> Watcher::end_at(std::chrono::steady_clock::time_point deadline) {
  deadline_.expires_at(deadline);
  const auto [error] = co_await deadline_.async_wait(kNoThrow);
  if (error || is_reached_) co_return;
  boost::system::error_code ignored;
  if (session_)
    session_->socket().close(ignored);
  else
    browser_->cut();
}

void Watcher::begin_deadline(std::chrono::seconds time) {
  const auto self = shared_from_this();
  asio::co_spawn(browser_->executor(), end_at(std::chrono::steady_clock::now() + time),
                 [self](std::exception_ptr failure) { rethrow(failure); });
}

// Coroutines here hold no temporaries across a co_await: GCC 12 miscompiles some of them otherwise.
asio::awaitable<void> Watcher::run() {
  begin_deadline(kJoinDeadline);
  const bool has_joined = co_await read_join();
  deadline_.cancel();
  if (has_joined) {
    const bool is_there = co_await reach_session();
    if (is_there) {
      ++bridge_.counters.watchers;
      ++bridge_.counters.joins;
      is_up_running_ = true;
      const auto self = shared_from_this();
      asio::co_spawn(browser_->executor(), relay_up(), [self](std::exception_ptr failure) {
        self->is_up_running_ = false;
        self->up_ended_.cancel();
        rethrow(failure);
      });
      co_await relay_down();
      --bridge_.counters.watchers;
    }
  }
  co_await browser_->close();
  cut();
  while (is_up_running_) co_await up_ended_.async_wait(kNoThrow);
}

asio::awaitable<bool> Watcher::read_join() {
  const auto first = co_await browser_->read();
  if (first.kind != BrowserMessage::Kind::Text) co_return false;
  const auto address = browser_->peer_address();
  const auto wait = bridge_.limiter.seconds_to_wait(address, monotonic_ns());
  if (wait > 0) {
    ++bridge_.counters.refused;
    std::string text =
        "too many wrong codes from here: wait " + std::to_string(wait) + " s, then try again";
    co_await refuse(proto::GOODBYE_TOO_MANY_TRIES, std::move(text));
    co_return false;
  }
  const auto refusal = read_join_request(first.bytes, request_);
  if (!refusal) co_return true;
  ++bridge_.counters.refused;
  if (refusal->fault == JoinFault::Code) {
    ++bridge_.counters.wrong_codes;
    bridge_.limiter.record_wrong_try(address, monotonic_ns());
  }
  std::string text = refusal->text;
  co_await refuse(
      refusal->fault == JoinFault::Code ? proto::GOODBYE_CODE_WRONG : proto::GOODBYE_PROTOCOL_ERROR,
      std::move(text));
  co_return false;
}

asio::awaitable<void> Watcher::refuse(int reason, std::string text) {
  proto::Envelope envelope;
  envelope.mutable_goodbye()->set_reason(static_cast<proto::GoodbyeReason>(reason));
  envelope.mutable_goodbye()->set_text(text);
  const auto frame = wire::encode_envelope(envelope);
  const BytesView body = BytesView(*frame).subspan(wire::kHeaderBytes);
  co_await browser_->write(body);
}

asio::awaitable<bool> Watcher::reach_session() {
  const auto* session = bridge_.find_session(request_.session);
  if (session == nullptr) {
    ++bridge_.counters.refused;
    std::string text = "the link names a session that is not here: ask for a new link";
    co_await refuse(proto::GOODBYE_PROTOCOL_ERROR, std::move(text));
    co_return false;
  }
  tcp::resolver resolver(browser_->executor());
  const std::string port = std::to_string(session->port);
  const auto [unresolved, endpoints] =
      co_await resolver.async_resolve(session->host, port, kNoThrow);
  if (!unresolved) {
    for (const auto& entry : endpoints) {
      tcp::socket socket(browser_->executor());
      boost::system::error_code ignored;
      const tcp::endpoint endpoint = entry.endpoint();
      socket.open(endpoint.protocol(), ignored);
      socket.set_option(asio::socket_base::receive_buffer_size(kReceiveBytes), ignored);
      session_.emplace(std::move(socket), bridge_.tls());
      begin_deadline(kReachDeadline);
      const auto [error] = co_await session_->socket().async_connect(endpoint, kNoThrow);
      if (!error) {
        session_->socket().set_option(tcp::no_delay(true), ignored);
        const bool is_secure = co_await secure_session(*session);
        is_reached_ = true;
        deadline_.cancel();
        co_return is_secure;
      }
      deadline_.cancel();
    }
  }
  ++bridge_.counters.unreachable;
  std::string text = "the session at " + session->name + " cannot be reached: is it running?";
  co_await refuse(proto::GOODBYE_SERVER_CLOSING, std::move(text));
  co_return false;
}

// Nothing is sent before the certificate is that of the code.
asio::awaitable<bool> Watcher::secure_session(const SessionAddress& session) {
  const auto error = co_await session_->begin_tls(session.host);
  if (error) {
    ++bridge_.counters.unreachable;
    std::string text = session.name + ": " + secure::describe_handshake_failure(error);
    co_await refuse(proto::GOODBYE_SERVER_CLOSING, std::move(text));
    co_return false;
  }
  const Bytes der = session_->peer_certificate_der();
  if (bridge_.code_of(der) != request_.code.certificate) {
    ++bridge_.counters.refused;
    ++bridge_.counters.wrong_codes;
    bridge_.limiter.record_wrong_try(browser_->peer_address(), monotonic_ns());
    std::string text = "the join code is not of this session: check it, or ask for a new link";
    co_await refuse(proto::GOODBYE_CODE_WRONG, std::move(text));
    co_return false;
  }
  const bool is_said = co_await say_hello();
  co_return is_said;
}

asio::awaitable<bool> Watcher::say_hello() {
  const auto hello = hello_of(request_);
  const std::vector<asio::const_buffer> buffers{asio::buffer(*hello)};
  const auto sent = co_await session_->write_all(buffers);
  co_return !sent.error;
}

void Watcher::note_refusal(BytesView envelope) {
  // Only small messages can be a Goodbye.
  constexpr std::size_t kMostGoodbye = 4096;
  proto::Envelope message;
  if (envelope.size() > kMostGoodbye || !wire::decode_envelope(envelope, message).ok() ||
      !message.has_goodbye())
    return;
  why_ = message.goodbye().text();
  if (message.goodbye().reason() != proto::GOODBYE_CODE_WRONG) return;
  ++bridge_.counters.wrong_codes;
  bridge_.limiter.record_wrong_try(browser_->peer_address(), monotonic_ns());
}

asio::awaitable<void> Watcher::relay_down() {
  std::array<std::uint8_t, wire::kHeaderBytes> header{};
  const auto address = browser_->peer_address();
  log::info("{} watches from {} as {}", printable(request_.name, 64), address,
            wire::name_of(request_.role));
  while (!is_cut_) {
    const auto head = co_await session_->read_all(asio::buffer(header));
    if (head.error) break;
    const auto length = wire::decode_length(header, wire::kMaxDownstreamBytes);
    if (!length) break;
    body_.resize(*length);
    const auto body = co_await session_->read_all(asio::buffer(body_));
    if (body.error) break;
    note_refusal(body_);
    ++bridge_.counters.messages_down;
    bridge_.counters.bytes_down += body_.size();
    const bool is_written = co_await browser_->write(body_);
    if (!is_written) break;
  }
  log::info("{} from {} has left{}{}", printable(request_.name, 64), address,
            why_.empty() ? "" : ": ", printable(why_, 200));
}

bool Watcher::may_pass(BytesView bytes) const {
  proto::Envelope message;
  if (bytes.size() > wire::kMaxUpstreamBytes - wire::kHeaderBytes ||
      !wire::decode_envelope(bytes, message).ok())
    return false;
  switch (message.message_case()) {
    case proto::Envelope::kFrameAck:
    case proto::Envelope::kPing:
    case proto::Envelope::kKeyframeRequest:
    case proto::Envelope::kMarkRequest:
    case proto::Envelope::kPointRequest:
    case proto::Envelope::kStrokeRequest:
    case proto::Envelope::kTeachRequest:
    case proto::Envelope::kViewRequest:
    case proto::Envelope::kGhostRequest:
    case proto::Envelope::kBye:
      return true;
    default:
      return false;
  }
}

asio::awaitable<bool> Watcher::send_up(BytesView envelope) {
  upward_.resize(wire::kHeaderBytes + envelope.size());
  const auto length = static_cast<std::uint32_t>(envelope.size());
  std::memcpy(upward_.data(), &length, sizeof length);
  std::copy(envelope.begin(), envelope.end(), upward_.begin() + wire::kHeaderBytes);
  const std::vector<asio::const_buffer> buffers{asio::buffer(upward_)};
  const auto sent = co_await session_->write_all(buffers);
  ++bridge_.counters.messages_up;
  bridge_.counters.bytes_up += envelope.size();
  co_return !sent.error;
}

// A page that says that it leaves is said to leave; one that is lost may come back, so that the
// session keeps its place.
asio::awaitable<void> Watcher::relay_up() {
  while (!is_cut_) {
    const auto message = co_await browser_->read();
    if (message.kind == BrowserMessage::Kind::Closed) {
      proto::Envelope envelope;
      envelope.mutable_bye()->set_reason("the page was closed");
      const auto frame = wire::encode_envelope(envelope);
      const BytesView body = BytesView(*frame).subspan(wire::kHeaderBytes);
      co_await send_up(body);
      break;
    }
    if (message.kind != BrowserMessage::Kind::Binary) break;
    if (!may_pass(message.bytes)) {
      why_ = "its page said something that a page may not say";
      break;
    }
    const bool is_sent = co_await send_up(message.bytes);
    if (!is_sent) break;
  }
  boost::system::error_code ignored;
  if (session_) session_->socket().close(ignored);
}

}  // namespace trocar::bridge
