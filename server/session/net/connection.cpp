#include "server/session/net/connection.h"

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <cstring>

#include "common/base/spawn.h"

namespace trocar::net {
namespace {

constexpr std::size_t kReadChunk = 8 * 1024;  // most upstream messages are far below 200 bytes
constexpr std::size_t kBuffersPerWrite = 16;

}  // namespace

const char* describe(ConnectionFault fault) {
  switch (fault) {
    case ConnectionFault::TlsGreeting:
      return "a greeting of TLS: this server speaks without it, so give --insecure-loopback too";
    case ConnectionFault::EmptyFrame:
      return "a frame of length zero";
    case ConnectionFault::OversizedFrame:
      return "a frame longer than 64 KiB";
    case ConnectionFault::HelloTimeout:
      return "no Hello within the deadline after connecting";
    case ConnectionFault::IdleTimeout:
      return "no message for too long: send a Ping every second";
  }
  return "unknown";
}

Connection::Connection(secure::Stream stream, std::string peer_address,
                       std::uint32_t max_message_bytes, std::size_t outbox_bytes,
                       wire::SharedBytes plain_reply)
    : stream_(std::move(stream)),
      peer_address_(std::move(peer_address)),
      outbox_changed_(stream_.socket().get_executor(), asio::steady_timer::time_point::max()),
      max_message_bytes_(max_message_bytes),
      outbox_bytes_(outbox_bytes),
      plain_reply_(std::move(plain_reply)),
      inbound_(kReadChunk) {}

void Connection::start(Events events) {
  events_ = std::move(events);
  if (!stream_.has_tls()) return begin();
  const auto self = shared_from_this();
  spawn(stream_.socket().get_executor(), greet(),
        [self](std::exception_ptr failure) { rethrow(failure); });
}

asio::awaitable<void> Connection::greet() {
  const auto greeting = co_await stream_.peek_greeting();
  if (state_ != State::Greeting) co_return;
  if (greeting == secure::Stream::Greeting::Other) co_await reply_plainly();
  if (greeting != secure::Stream::Greeting::Tls) {
    close();
    co_return;
  }
  const auto error = co_await stream_.accept_tls();
  if (error || state_ != State::Greeting)
    close();
  else
    begin();
}

// It fits into the socket's buffer, so nobody can hold this up. What the peer has sent is taken
// first: a socket that is closed with unread bytes resets, and the reply could be lost.
asio::awaitable<void> Connection::reply_plainly() {
  if (!plain_reply_) co_return;
  boost::system::error_code ignored;
  auto& socket = stream_.socket();
  socket.non_blocking(true, ignored);
  socket.read_some(asio::buffer(inbound_), ignored);
  socket.write_some(asio::buffer(*plain_reply_), ignored);
  socket.shutdown(asio::ip::tcp::socket::shutdown_send, ignored);
  bool is_gone = false;
  while (!is_gone) {
    const auto [error, count] = co_await socket.async_read_some(asio::buffer(inbound_), kNoThrow);
    is_gone = error.failed();
  }
}

void Connection::begin() {
  state_ = State::Open;
  // A coroutine that is a member function keeps only `this`; the lambda's copy of the pointer lives
  // in the completion handler until the coroutine has ended.
  const auto self = shared_from_this();
  const auto executor = stream_.socket().get_executor();
  spawn(executor, read_frames(), [self](std::exception_ptr failure) { rethrow(failure); });
  spawn(executor, write_outbox(), [self](std::exception_ptr failure) { rethrow(failure); });
  const auto opened = events_.open;
  if (opened) opened();
}

bool Connection::send(wire::SharedBytes frame) {
  if (state_ != State::Open && state_ != State::Failed) return false;
  if (is_peer_gone_) return true;
  const std::size_t size = frame->size();
  if (outstanding_ > 0 && outstanding_ + size > outbox_bytes_) return false;
  outstanding_ += size;
  outbox_.push_back(std::move(frame));
  outbox_changed_.cancel();
  return true;
}

void Connection::close_after_flush(wire::SharedBytes last_words, Clock::time_point deadline) {
  if (state_ == State::Draining || state_ == State::Closed) return;
  state_ = State::Draining;
  drain_deadline_ = deadline;
  if (last_words && !is_peer_gone_) {
    outstanding_ += last_words->size();
    outbox_.push_back(std::move(last_words));
  }
  outbox_changed_.cancel();
}

void Connection::discard_outbox() {
  outbox_.clear();
  in_flight_.clear();
  outstanding_ = 0;
}

void Connection::close() {
  if (state_ == State::Closed) return;
  state_ = State::Closed;
  boost::system::error_code ignored;
  stream_.socket().close(ignored);
  outbox_.clear();  // in_flight_ stays until the writer wakes: the kernel may still read from it
  outstanding_ = 0;
  outbox_changed_.cancel();
  // Moved out first: the handler may drop the last outside reference to this connection.
  const auto self = shared_from_this();
  const auto closed = std::move(events_.closed);
  events_ = {};
  if (closed) closed();
}

void Connection::fail(ConnectionFault fault) {
  if (state_ != State::Open) return;
  state_ = State::Failed;
  const auto self = shared_from_this();
  const auto report = events_.fault;
  if (report) report(fault);
  // A handler that does nothing must not leave a connection behind that nobody reads.
  if (state_ == State::Failed) close();
}

void Connection::check_deadlines(Clock::time_point now, Clock::duration idle) {
  if (state_ == State::Draining && now >= drain_deadline_) return close();
  if (state_ == State::Open && first_message_seen_ && now - last_message_ > idle)
    fail(ConnectionFault::IdleTimeout);
}

bool Connection::deliver_frames() {
  while (state_ == State::Open && end_ - begin_ >= wire::kHeaderBytes) {
    std::uint32_t length = 0;
    std::memcpy(&length, inbound_.data() + begin_, sizeof length);
    if (!first_message_seen_ && secure::is_tls_greeting(BytesView(inbound_).subspan(begin_, 4)) &&
        length > max_message_bytes_) {
      fail(ConnectionFault::TlsGreeting);
      break;
    }
    if (length == 0) {
      fail(ConnectionFault::EmptyFrame);
      break;
    }
    if (length > max_message_bytes_) {
      fail(ConnectionFault::OversizedFrame);
      break;
    }
    const std::size_t frame_bytes = wire::kHeaderBytes + length;
    if (end_ - begin_ < frame_bytes) {
      if (inbound_.size() < frame_bytes) inbound_.resize(frame_bytes);
      return true;
    }
    first_message_seen_ = true;
    last_message_ = Clock::now();
    const BytesView body{inbound_.data() + begin_ + wire::kHeaderBytes, length};
    begin_ += frame_bytes;
    // Copied: the callback may close this connection, which clears events_.
    const auto deliver = events_.message;
    deliver(body);
  }
  return state_ == State::Open || state_ == State::Draining;
}

asio::awaitable<void> Connection::read_frames() {
  while (state_ == State::Open || state_ == State::Draining) {
    if (state_ == State::Draining) begin_ = end_ = 0;
    if (begin_ > 0) {
      std::memmove(inbound_.data(), inbound_.data() + begin_, end_ - begin_);
      end_ -= begin_;
      begin_ = 0;
    }
    const auto room = asio::buffer(inbound_.data() + end_, inbound_.size() - end_);
    const auto [error, count] = co_await stream_.read_some(room);
    if (error) break;
    end_ += count;
    if (!deliver_frames()) break;
  }
  close();
}

asio::awaitable<void> Connection::write_outbox() {
  std::vector<asio::const_buffer> buffers;
  while (state_ != State::Closed) {
    if (outbox_.empty()) {
      if (state_ == State::Draining) {
        boost::system::error_code ignored;
        stream_.socket().shutdown(asio::ip::tcp::socket::shutdown_send, ignored);
        co_return;  // the reader closes when the peer does, or the deadline
      }
      co_await outbox_changed_.async_wait(kNoThrow);
      continue;
    }
    buffers.clear();
    const auto count = std::min(outbox_.size(), kBuffersPerWrite);
    for (std::size_t i = 0; i < count; ++i) {
      in_flight_.push_back(std::move(outbox_.front()));
      outbox_.pop_front();
      buffers.emplace_back(in_flight_.back()->data(), in_flight_.back()->size());
    }
    const auto [error, written] = co_await stream_.write_all(buffers);
    in_flight_.clear();
    if (state_ == State::Closed) break;
    if (error) {
      stop_writing();
      co_return;
    }
    outstanding_ -= std::min(outstanding_, written);
    if (events_.bytes_written) events_.bytes_written(written);
  }
  discard_outbox();
}

// Whoever has gone may have said Bye before: it is read first, and then the reader closes.
void Connection::stop_writing() {
  is_peer_gone_ = true;
  discard_outbox();
  boost::system::error_code ignored;
  stream_.socket().shutdown(asio::ip::tcp::socket::shutdown_both, ignored);
}

}  // namespace trocar::net
