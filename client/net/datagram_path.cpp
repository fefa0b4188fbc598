#include "client/net/datagram_path.h"

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>

#include "common/base/no_throw.h"
#include "common/base/spawn.h"
#include "common/wire/framing.h"

namespace trocar::net {
namespace {

using asio::ip::udp;
using namespace std::chrono_literals;
using std::chrono::milliseconds;

constexpr milliseconds kTendPeriod = 50ms;
constexpr milliseconds kHandshakePatience = 3s;
constexpr milliseconds kSilence = 2s;
constexpr milliseconds kFirstPause = 500ms, kLongestPause = 5s;
// Claims lapse after 250 ms without samples, so the stream takes over before.
constexpr milliseconds kFreshness = 150ms;
// An acknowledgement waits so long for a sample to travel with.
constexpr milliseconds kSampleGap = 12ms;
constexpr milliseconds kKeepAlive = 100ms;
constexpr std::size_t kRepeated = 3;
// The pose of a hand that feels is repeated so long. A hand at rest so sends one pose, not three.
constexpr std::uint64_t kRepeatedUs = 10'000;
constexpr int kReceiveBufferBytes = 512 * 1024;

// The server may have missed that the verb has changed since.
bool is_worth_repeating(const proto::ToolSample& sample, const proto::ToolSample& newest) {
  return sample.verb() != newest.verb() ||
         sample.client_time_us() + kRepeatedUs >= newest.client_time_us();
}

}  // namespace

struct DatagramPath::Try {
  explicit Try(asio::io_context& context) : socket(context) {}
  udp::socket socket;
  std::unique_ptr<secure::DatagramChannel> channel;
  Clock::time_point begin = Clock::now();
  Bytes room = Bytes(2 * secure::kDatagramBytes);
};

DatagramPath::DatagramPath(asio::io_context& context, udp::endpoint server, secure::DatagramKey key,
                           Deliver deliver)
    : context_(context),
      server_(std::move(server)),
      key_(key),
      deliver_(std::move(deliver)),
      timer_(context),
      pause_(kFirstPause) {
  begin_try();
  spawn(context_.get_executor(), tend(is_alive_),
        [](std::exception_ptr failure) { rethrow(failure); });
}

DatagramPath::~DatagramPath() {
  *is_alive_ = false;
  timer_.cancel();
  end_try();
}

void DatagramPath::begin_try() {
  boost::system::error_code error, ignored;
  auto next = std::make_shared<Try>(context_);
  next->socket.open(server_.protocol(), error);
  if (!error) next->socket.connect(server_, error);
  if (!error) next->socket.non_blocking(true, error);
  next_try_ = Clock::now() + pause_;
  if (error) return;  // no such network at present
  next->socket.set_option(asio::socket_base::receive_buffer_size(kReceiveBufferBytes), ignored);
  auto* socket = &next->socket;
  next->channel = secure::DatagramChannel::make_client(key_, [this, socket](BytesView datagram) {
    boost::system::error_code lost;
    socket->send(asio::buffer(datagram.data(), datagram.size()), 0, lost);
    if (!lost) bytes_sent_ += datagram.size();
  });
  try_ = std::move(next);
  try_->channel->start();
  spawn(context_.get_executor(), receive(try_, is_alive_),
        [](std::exception_ptr failure) { rethrow(failure); });
}

void DatagramPath::end_try() {
  if (!try_) return;
  boost::system::error_code ignored;
  loss_.restart();
  try_->socket.close(ignored);
  try_.reset();
}

asio::awaitable<void> DatagramPath::receive(std::shared_ptr<Try> current,
                                            std::shared_ptr<bool> is_alive) {
  while (*is_alive && try_ == current) {
    const auto [error, count] =
        co_await current->socket.async_receive(asio::buffer(current->room), kNoThrow);
    if (!*is_alive || try_ != current) break;
    if (error == asio::error::operation_aborted) break;
    if (error) {  // nobody listens there, perhaps not yet; tend() tries again
      end_try();
      break;
    }
    bytes_received_ += count;
    const auto datagram = BytesView(current->room).first(count);
    const bool was_open = current->channel->state() == secure::DatagramChannel::State::Open;
    current->channel->receive(datagram, [this, datagram](BytesView message) {
      loss_.note(datagram);
      take(message);
    });
    const bool is_open = current->channel->state() == secure::DatagramChannel::State::Open;
    if (is_open && !was_open) {
      last_heard_ = Clock::now();
      pause_ = kFirstPause;
      send();  // so that the server knows that its end is open
    }
  }
}

asio::awaitable<void> DatagramPath::tend(std::shared_ptr<bool> is_alive) {
  while (*is_alive) {
    timer_.expires_after(kTendPeriod);
    co_await timer_.async_wait(kNoThrow);
    if (!*is_alive) break;
    tend_try(Clock::now());
  }
}

void DatagramPath::tend_try(Clock::time_point now) {
  if (!try_) {
    if (now >= next_try_) begin_try();
    return;
  }
  auto& channel = *try_->channel;
  if (const auto left = channel.next_timeout(); left && left->count() == 0) channel.on_timeout();
  const bool is_open = channel.state() == secure::DatagramChannel::State::Open;
  const bool is_over = channel.state() == secure::DatagramChannel::State::Failed ||
                       (!is_open && now - try_->begin > kHandshakePatience) ||
                       (is_open && now - last_heard_ > kSilence);
  if (is_over) {
    end_try();
    next_try_ = now + pause_;
    pause_ = std::min(2 * pause_, kLongestPause);
  } else if (is_open && now - last_sent_ > kKeepAlive) {
    send();
  }
}

void DatagramPath::take(BytesView bytes) {
  auto message = std::make_shared<proto::Envelope>();
  if (!wire::decode_envelope(bytes, *message)) return;  // the server's fault, and no harm
  ++received_;
  last_heard_ = Clock::now();
  if (message->has_surface_slice()) last_frame_ = last_heard_;
  if (message->has_datagram_probe()) return send();
  deliver_(std::move(message), bytes.size());
}

bool DatagramPath::is_fresh() const {
  return try_ && try_->channel->state() == secure::DatagramChannel::State::Open &&
         Clock::now() - last_frame_ <= kFreshness;
}

bool DatagramPath::carry(const proto::Envelope& message) {
  const auto now = Clock::now();
  if (message.has_tool_sample()) {
    const auto& sample = message.tool_sample();
    if (sample.tool() >= samples_.size()) return false;
    auto& last = samples_[sample.tool()];
    last.push_back(sample);
    if (last.size() > kRepeated) last.pop_front();
    send();
  } else if (message.has_frame_ack()) {
    ack_ = message.frame_ack();
    has_ack_ = true;
    if (now - last_sent_ > kSampleGap) send();
  } else {
    return false;
  }
  return is_fresh();
}

void DatagramPath::send() {
  if (!try_ || try_->channel->state() != secure::DatagramChannel::State::Open) return;
  proto::Envelope envelope;
  auto& datagram = *envelope.mutable_client_datagram();
  for (const auto& last : samples_)
    for (const auto& sample : last)
      if (is_worth_repeating(sample, last.back())) *datagram.add_sample() = sample;
  if (has_ack_) *datagram.mutable_ack() = ack_;
  datagram.set_datagrams_received(received_);
  const auto bytes = envelope.SerializeAsString();
  try_->channel->send(bytes_of(std::string_view(bytes)));
  last_sent_ = Clock::now();
}

}  // namespace trocar::net
