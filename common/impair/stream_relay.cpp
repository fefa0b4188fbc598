#include "common/impair/stream_relay.h"

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/write.hpp>

#include "common/base/spawn.h"

namespace trocar::impair {
namespace {

using asio::ip::tcp;
// Small, so that back-pressure is felt on the other side of the proxy.
constexpr int kSocketBuffer = 64 * 1024;
constexpr int kLeastReceiveBuffer = 4 * 1024;
constexpr std::size_t kMostWritten = 64 * 1024;

void prepare(tcp::socket& socket) {
  boost::system::error_code ignored;
  socket.set_option(tcp::no_delay(true), ignored);
  socket.set_option(asio::socket_base::send_buffer_size(kSocketBuffer), ignored);
}

}  // namespace

int receive_buffer_bytes(const Impairment& impairment) {
  if (impairment.rate <= 0) return kSocketBuffer;
  const double backlog = impairment.rate * std::chrono::duration<double>(impairment.queue).count();
  return static_cast<int>(std::clamp(backlog, double{kLeastReceiveBuffer}, double{kSocketBuffer}));
}

StreamRelay::Half::Half(Direction& direction, const Network& network, Flow flow,
                        std::uint64_t number, tcp::socket& reads, tcp::socket& writes)
    : from(reads),
      to(writes),
      line(direction, network.options.cut, network.round_trip(),
           seed_of(network.options.seed, flow, number)),
      has_arrived(reads.get_executor()),
      has_departed(reads.get_executor()) {}

StreamRelay::StreamRelay(std::shared_ptr<Network> network, tcp::socket client, std::uint64_t number)
    : network_(std::move(network)),
      client_(std::move(client)),
      server_(client_.get_executor()),
      up_(network_->up, *network_, Flow::StreamUp, number, client_, server_),
      down_(network_->down, *network_, Flow::StreamDown, number, server_, client_) {}

void StreamRelay::run(asio::awaitable<void> work) {
  spawn(client_.get_executor(), std::move(work),
        [self = shared_from_this()](std::exception_ptr failure) { rethrow(failure); });
}

void StreamRelay::start(std::function<void()> closed) {
  closed_ = std::move(closed);
  prepare(client_);
  run(connect());
}

void StreamRelay::close() {
  closed_ = nullptr;
  finish();
}

void StreamRelay::finish() {
  if (is_closed_) return;
  is_closed_ = true;
  boost::system::error_code ignored;
  client_.close(ignored);
  server_.close(ignored);
  for (auto* half : {&up_, &down_}) {
    half->has_arrived.cancel();
    half->has_departed.cancel();
  }
  const auto self = shared_from_this();
  if (const auto closed = std::move(closed_)) closed();
}

asio::awaitable<void> StreamRelay::connect() {
  boost::system::error_code ignored;
  server_.open(network_->stream_server.protocol(), ignored);
  server_.set_option(
      asio::socket_base::receive_buffer_size(receive_buffer_bytes(network_->down.impairment)),
      ignored);
  const auto [error] = co_await server_.async_connect(network_->stream_server, kNoThrow);
  if (is_closed_) co_return;
  if (error) {
    finish();
    co_return;
  }
  prepare(server_);
  for (auto* half : {&up_, &down_}) {
    run(read(*half));
    run(write(*half));
  }
}

asio::awaitable<void> StreamRelay::read(Half& half) {
  Bytes chunk(half.line.chunk_bytes());
  while (!is_closed_) {
    if (!half.is_done && !half.line.has_room(network_->now())) {
      const Time at = half.line.room_at();
      half.has_departed.expires_at(network_->due(at > network_->now() ? at : kNever));
      co_await half.has_departed.async_wait(kNoThrow);
      continue;
    }
    const auto [error, count] = co_await half.from.async_read_some(asio::buffer(chunk), kNoThrow);
    if (is_closed_) break;
    if (!half.is_done) {
      half.line.push(network_->now(), BytesView(chunk).first(count));
      if (error)
        half.line.end(network_->now(),
                      error == asio::error::eof ? StreamEnd::Finished : StreamEnd::Reset);
      half.has_arrived.cancel();
    }
    if (error) break;
  }
}

asio::awaitable<void> StreamRelay::write(Half& half) {
  Bytes batch;
  StreamEnd end = StreamEnd::None;
  while (!is_closed_ && end == StreamEnd::None) {
    const Time now = network_->now();
    if (half.line.next() > now) {
      half.has_arrived.expires_at(network_->due(half.line.next()));
      co_await half.has_arrived.async_wait(kNoThrow);
      continue;
    }
    batch.clear();
    while (end == StreamEnd::None && batch.size() < kMostWritten && half.line.next() <= now) {
      const auto departure = half.line.pop(now);
      batch.insert(batch.end(), departure.bytes.begin(), departure.bytes.end());
      end = departure.end;
    }
    half.has_departed.cancel();
    if (batch.empty()) continue;
    const auto [error, count] = co_await asio::async_write(half.to, asio::buffer(batch), kNoThrow);
    if (error) break;
  }
  if (is_closed_) co_return;
  boost::system::error_code ignored;
  if (end == StreamEnd::Reset) {
    half.to.set_option(asio::socket_base::linger(true, 0), ignored);  // so that it sees a reset
    finish();
    co_return;
  }
  if (end == StreamEnd::Finished) half.to.shutdown(tcp::socket::shutdown_send, ignored);
  half.is_done = true;
  half.has_departed.cancel();
  if (up_.is_done && down_.is_done) finish();
}

}  // namespace trocar::impair
