#include "server/app/hall/hall_bus.h"

#include <unistd.h>

#include <array>
#include <boost/asio/post.hpp>
#include <cctype>
#include <chrono>
#include <ctime>

namespace trocar::app {
namespace {

constexpr std::chrono::seconds kPublishPeriod{2};

// Nobody makes a hall say something elsewhere on the bus than to who asks.
bool may_answer(const std::string& subject) {
  return subject.starts_with("_INBOX.");
}

}  // namespace

std::string request_subject(const std::string& hall_name) {
  return "trocar.hall." + hall_name + ".request";
}

std::string hall_name(std::uint16_t port) {
  std::array<char, 256> machine{};
  std::string name;
  if (::gethostname(machine.data(), machine.size() - 1) == 0) name = machine.data();
  if (name.empty()) name = "hall";
  for (char& c : name) {
    c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    const bool is_fine = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
    if (!is_fine) c = '-';
  }
  return name + "-" + std::to_string(port);
}

HallBus::HallBus(asio::io_context& context, HallServer& server, const std::string& key)
    : context_(context),
      server_(server),
      name_(hall_name(server.port())),
      proofs_(name_, key),
      timer_(context) {}

Result<std::unique_ptr<HallBus>> HallBus::open(asio::io_context& context, HallServer& server,
                                               const bus::BusPlace& place, const std::string& key) {
  std::unique_ptr<HallBus> made(new HallBus(context, server, key));
  auto bus = bus::Bus::connect(place, "trocar-hall " + made->name_, true);
  if (!bus) return bus.error();
  made->bus_ = std::move(*bus);
  if (const auto subscribed = made->subscribe(); !subscribed) return subscribed.error();
  made->publish_often();
  return made;
}

// The bus calls on threads of its own; answers are made on the context's.
Status HallBus::subscribe() {
  const std::weak_ptr<bool> alive = is_alive_;
  const auto heard = bus_->subscribe(
      kDirectorySubject, [this, alive](const std::string&, const std::string& answer_to) {
        if (!may_wait()) return;
        asio::post(context_, [this, alive, answer_to] {
          if (alive.expired()) return;
          --waiting_;
          if (may_answer(answer_to)) bus_->publish(answer_to, directory());
        });
      });
  if (!heard) return heard;
  return bus_->subscribe(request_subject(name_),
                         [this, alive](const std::string& text, const std::string& answer_to) {
                           if (text.size() > kMostRequestText || !may_wait()) return;
                           asio::post(context_, [this, alive, text, answer_to] {
                             if (alive.expired()) return;
                             --waiting_;
                             if (may_answer(answer_to)) take_request(text, answer_to);
                           });
                         });
}

std::string HallBus::directory() const {
  return server_.directory(name_, proofs_.start());
}

bool HallBus::may_wait() {
  if (++waiting_ <= kMostWaiting) return true;
  --waiting_;
  return false;
}

void HallBus::take_request(const std::string& text, const std::string& answer_to) {
  const auto request = hall::read_bus_request(text);
  if (!request) return;
  const auto proof = proofs_.check(*request, std::time(nullptr));
  const std::weak_ptr<bus::Bus> bus = bus_;
  server_.answer(*request, proof, [bus, answer_to](const std::string& answer) {
    if (const auto still = bus.lock()) still->publish(answer_to, answer);
  });
}

void HallBus::publish_often() {
  bus_->publish(kStateSubject, directory());
  timer_.expires_after(kPublishPeriod);
  timer_.async_wait([this](boost::system::error_code error) {
    if (!error && bus_) publish_often();
  });
}

void HallBus::stop() {
  is_alive_.reset();
  timer_.cancel();
  bus_.reset();
}

}  // namespace trocar::app
