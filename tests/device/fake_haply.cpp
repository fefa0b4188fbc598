#include "tests/device/fake_haply.h"

#include <sys/socket.h>
#include <unistd.h>

#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <utility>

namespace trocar::testing {
namespace {

namespace websocket = boost::beast::websocket;
using boost::asio::ip::tcp;

}  // namespace

FakeHaply::FakeHaply(std::string inventory, Answer answer)
    : FakeHaply([inventory = std::move(inventory)] { return inventory; }, std::move(answer),
                [] {}) {}

FakeHaply::FakeHaply(Inventory inventory, Answer answer, std::function<void()> on_end)
    : inventory_(std::move(inventory)),
      answer_(answer ? std::move(answer)
                     : [this](int, const std::string&) { return std::optional(inventory_()); }),
      on_end_(std::move(on_end)),
      acceptor_(context_, tcp::endpoint(boost::asio::ip::address_v4::loopback(), 0)),
      thread_([this] { serve(); }) {}

FakeHaply::~FakeHaply() {
  // The thread waits for one of these, and they end.
  is_ending_ = true;
  shutdown(acceptor_.native_handle(), SHUT_RDWR);
  shutdown(client_, SHUT_RDWR);
  thread_.join();
  close(client_);
}

std::string FakeHaply::url() const {
  return "ws://127.0.0.1:" + std::to_string(acceptor_.local_endpoint().port());
}

std::vector<std::string> FakeHaply::messages() const {
  const std::lock_guard guard(lock_);
  return messages_;
}

std::string FakeHaply::state(double x, double y, double z) {
  return R"({"session_id":7,"inverse3":[{"device_id":"049D","state":{"cursor_position":{"x":)" +
         std::to_string(x) + R"(,"y":)" + std::to_string(y) + R"(,"z":)" + std::to_string(z) +
         R"(},"cursor_velocity":{"x":0.1,"y":0.2,"z":0.3},"control_mode":"idle"}}],)"
         R"("wireless_verse_grip":[{"device_id":"61548","state":{"orientation":)"
         R"({"w":0,"x":0,"y":0,"z":1},"buttons":{"a":true,"b":false,"c":true}}}]})";
}

void FakeHaply::serve() {
  while (!is_ending_) {
    boost::system::error_code failure;
    tcp::socket socket(context_);
    acceptor_.accept(socket, failure);
    if (failure) return;
    const int before = client_.exchange(dup(socket.native_handle()));
    if (before >= 0) close(before);
    if (is_ending_) return;
    serve_client(socket);
    on_end_();
  }
}

void FakeHaply::serve_client(tcp::socket& socket) {
  boost::system::error_code failure;
  websocket::stream<tcp::socket&> stream(socket);
  stream.accept(failure);
  if (failure) return;
  stream.text(true);
  const std::string inventory = inventory_();
  if (!inventory.empty()) stream.write(boost::asio::buffer(inventory), failure);
  while (!failure) {
    boost::beast::flat_buffer buffer;
    stream.read(buffer, failure);
    if (failure) break;
    const std::string message(static_cast<const char*>(buffer.cdata().data()), buffer.size());
    {
      const std::lock_guard guard(lock_);
      messages_.push_back(message);
    }
    const auto answer = answer_(number_++, message);
    if (answer == "hang up") {
      shutdown(client_, SHUT_RDWR);
      return;
    }
    if (answer) stream.write(boost::asio::buffer(*answer), failure);
  }
  was_closed_ = failure == websocket::error::closed;
}

}  // namespace trocar::testing
