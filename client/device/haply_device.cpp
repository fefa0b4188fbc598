#include "client/device/haply_device.h"

#include "common/base/asio.h"  // before Boost: see there

#include <atomic>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket/error.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <chrono>
#include <future>
#include <optional>
#include <thread>
#include <utility>

#include "client/device/crash.h"
#include "client/device/device_checks.h"
#include "client/device/device_exchange.h"
#include "client/device/haply_messages.h"
#include "common/base/no_throw.h"
#include "common/base/spawn.h"

namespace trocar::device {
namespace {

using tcp = asio::ip::tcp;
using Clock = asio::steady_timer::clock_type;
namespace websocket = boost::beast::websocket;

constexpr std::chrono::milliseconds kHaplyCloseTime{2000}, kHaplyPatience{1000}, kHaplyPace{1};
constexpr int kHaplyMostBad = 100;  // in a row

// The documents that could be read name no figures; a public client of the service cuts at 2 N.
constexpr DeviceLimits kHaplyLimits{
    .force_n = 2, .rate_hz = 1000, .stiffness_n_m = 800, .workspace_m = {0.15, 0.12, 0.1}};

Error haply_gone(const std::string& why) {
  return {ErrorCode::ResourceMissing,
          why + ", start the Haply Inverse Service (or the Haply Hub) and plug the device in"};
}

}  // namespace

// All members but `exchange` belong to the thread once it runs.
class HaplyDevice::Conversation {
 public:
  Conversation(std::string url, HaplyAddress address, std::chrono::milliseconds patience)
      : url_(std::move(url)), address_(std::move(address)), patience_(patience) {}
  ~Conversation() {
    asio::post(context_, [this] { close(); });
    thread_.join();
  }

  Status begin() {
    auto opened = opened_.get_future();
    spawn(context_.get_executor(), run(), rethrow);
    thread_ = std::thread([this] { run_context(); });
    return opened.get();
  }
  // Constant after begin().
  const std::string& device_id() const { return device_id_; }

  DeviceExchange exchange;

 private:
  void run_context() {
    try {
      context_.run();
    } catch (const std::exception& failure) {
      end(haply_gone(std::string("the connection to the Haply service failed: ") + failure.what()));
    }
  }

  // The first reason counts, for open() or for read().
  void end(Error why) {
    if (is_open_)
      exchange.fail(std::move(why));
    else if (!std::exchange(is_refused_, true))
      opened_.set_value(std::move(why));
  }

  asio::awaitable<void> run() {
    limit(patience_);
    co_await converse();
    is_finished_ = true;
    deadline_.cancel();
    hang_up();
  }

  void hang_up() {
    last_words_.reset();
    boost::system::error_code ignored;
    socket().close(ignored);
  }

  asio::awaitable<void> converse() {
    tcp::resolver resolver(context_);
    auto [not_found, places] =
        co_await resolver.async_resolve(address_.host, address_.port, kNoThrow);
    boost::system::error_code failure = not_found;
    for (const auto& place : places) {
      if (is_late_) break;
      if (socket().is_open()) socket().close(failure);
      std::tie(failure) = co_await socket().async_connect(place.endpoint(), kNoThrow);
      if (!failure) break;
    }
    if (!failure) {
      socket().set_option(tcp::no_delay(true), failure);
      stream_.read_message_max(kHaplyMessageBytes);
      std::tie(failure) = co_await stream_.async_handshake(address_.host, "/", kNoThrow);
    }
    if (failure) {
      end(haply_gone(url_ + ": " + (is_late_ ? "nobody answers" : failure.message())));
      co_return;
    }
    const bool is_inventory = co_await read_message();
    if (!is_inventory) co_return;
    deadline_.cancel();
    is_open_ = true;
    last_words_.emplace(socket().native_handle(),
                        websocket_frame(haply_command(device_id_, Vec3d{}, false)));
    opened_.set_value(Status{});
    spawn(context_.get_executor(), read_states(), rethrow);
    co_await send_forces();
  }

  // False: it was the last one.
  asio::awaitable<bool> read_message() {
    buffer_.clear();
    auto [failure, bytes] = co_await stream_.async_read(buffer_, kNoThrow);
    if (failure) {
      const bool is_long = failure == websocket::error::message_too_big ||
                           failure == websocket::error::buffer_overflow;
      end(haply_gone(is_long    ? "the Haply service sent a message without end"
                     : is_late_ ? url_ + ": nobody answers"
                                : "the Haply service closed the connection"));
      co_return false;
    }
    co_return take(
        std::string_view(static_cast<const char*>(buffer_.cdata().data()), buffer_.size()));
  }

  bool take(std::string_view text) {
    auto state = read_haply_state(text, device_id_);
    if (!state) {
      if (is_open_ && ++bad_messages_ < kHaplyMostBad) return true;
      end(state.error());
      return false;
    }
    bad_messages_ = 0;
    if (state->device_id.empty()) {
      end(haply_gone(device_id_.empty() ? "the Haply service has no Inverse3"
                                        : "the Inverse3 " + device_id_ + " is gone"));
      return false;
    }
    if (device_id_.empty()) device_id_ = state->device_id;
    state->reading.time_us = monotonic_us();
    exchange.publish(state->reading);
    return true;
  }

  asio::awaitable<void> read_states() {
    for (;;) {
      const bool is_message = co_await read_message();
      if (!is_message) break;
      is_answered_ = true;
      answer_timer_.cancel();
    }
    is_done_ = true;
    answer_timer_.cancel();
    pace_timer_.cancel();
  }

  asio::awaitable<void> send_forces() {
    std::string text;
    for (int number = 0; !is_closing_ && !is_done_; number = 1) {
      const auto next = Clock::now() + kHaplyPace;
      text = haply_command(device_id_, exchange.order(monotonic_us()).force_n, number == 0);
      is_answered_ = false;
      const auto [failure, bytes] = co_await stream_.async_write(asio::buffer(text), kNoThrow);
      if (failure) co_return;
      // The reader runs on this thread too, so it cannot answer between the test and the wait.
      answer_timer_.expires_after(kHaplyPatience);
      if (!is_answered_ && !is_closing_ && !is_done_) co_await answer_timer_.async_wait(kNoThrow);
      pace_timer_.expires_at(next);
      if (!is_closing_ && !is_done_) co_await pace_timer_.async_wait(kNoThrow);
    }
    if (is_done_) co_return;
    limit(kHaplyCloseTime);
    text = haply_command(device_id_, Vec3d{}, false);
    const auto [failure, bytes] = co_await stream_.async_write(asio::buffer(text), kNoThrow);
    if (!failure) co_await stream_.async_close(websocket::close_code::normal, kNoThrow);
  }

  void close() {
    if (is_finished_) return;
    is_closing_ = true;
    answer_timer_.cancel();
    pace_timer_.cancel();
    limit(kHaplyCloseTime);
  }

  // Whatever is under way then ends, by the end of its socket.
  void limit(std::chrono::milliseconds time) {
    deadline_.expires_after(time);
    deadline_.async_wait([this](const boost::system::error_code& cancelled) {
      if (cancelled) return;
      is_late_ = true;
      hang_up();
    });
  }

  tcp::socket& socket() { return stream_.next_layer(); }

  const std::string url_;
  const HaplyAddress address_;
  const std::chrono::milliseconds patience_;  // while it opens
  asio::io_context context_{1};
  websocket::stream<tcp::socket> stream_{context_};
  boost::beast::flat_buffer buffer_{kHaplyMessageBytes};
  asio::steady_timer deadline_{context_}, answer_timer_{context_}, pace_timer_{context_};
  std::promise<Status> opened_;
  std::string device_id_;
  std::optional<LastWords> last_words_;
  int bad_messages_ = 0;
  bool is_open_ = false, is_refused_ = false, is_answered_ = false;
  bool is_closing_ = false, is_late_ = false, is_done_ = false, is_finished_ = false;
  std::thread thread_;
};

HaplyDevice::HaplyDevice(std::unique_ptr<Conversation> conversation)
    : conversation_(std::move(conversation)) {}
HaplyDevice::~HaplyDevice() = default;

Result<std::unique_ptr<HapticDevice>> HaplyDevice::open(const std::string& url,
                                                        std::chrono::milliseconds patience) {
  auto address = parse_haply_address(url);
  if (!address)
    return Error{ErrorCode::Usage,
                 "the address of the Haply service is not understood, write for example "
                 "haply:ws://localhost:10001"};
  auto conversation = std::make_unique<Conversation>(url, std::move(*address), patience);
  if (auto status = conversation->begin(); !status) return status.error();
  return std::unique_ptr<HapticDevice>(new HaplyDevice(std::move(conversation)));
}

Result<DeviceReading> HaplyDevice::read() {
  return conversation_->exchange.read();
}

Status HaplyDevice::write(const Vec3d& force_n, const Vec3d& torque_nm) {
  return conversation_->exchange.write(force_n, torque_nm, kHaplyLimits);
}

DeviceLimits HaplyDevice::limits() const {
  return kHaplyLimits;
}

std::string HaplyDevice::description() const {
  return "Haply Inverse3 " + conversation_->device_id();
}

}  // namespace trocar::device
