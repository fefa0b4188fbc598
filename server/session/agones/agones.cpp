#include "server/session/agones/agones.h"

#include <fmt/format.h>

#include <boost/asio/steady_timer.hpp>
#include <charconv>
#include <cstring>
#include <set>
#include <utility>

#include "common/base/json.h"
#include "common/base/log.h"
#include "common/base/no_throw.h"
#include "common/base/printable.h"
#include "common/base/spawn.h"
#include "common/http/ask.h"

namespace trocar::agones {
namespace {

constexpr unsigned kOk = 200;

http::Question question(std::uint16_t port, const char* method, const char* path) {
  return {.host = "127.0.0.1", .port = port, .method = method, .path = path, .body = "{}"};
}

Status taken(const Result<http::Answer>& answer) {
  if (!answer) return answer.error();
  if (answer->status == kOk) return {};
  return Error{ErrorCode::Refused, fmt::format("it answers {}", answer->status)};
}

}  // namespace

Result<std::uint16_t> sidecar_port(const char* text) {
  if (text == nullptr) return kDefaultPort;
  std::uint16_t port = 0;
  const char* end = text + std::strlen(text);
  const auto [stopped, failed] = std::from_chars(text, end, port);
  if (failed == std::errc() && stopped == end && port > 0) return port;
  return Error{ErrorCode::Usage, fmt::format("{}: {} is not a port from 1 to 65535", kPortVariable,
                                             printable(text, 32))};
}

Result<Place> read_place(const std::string& text) {
  const auto json = Json::parse(text, nullptr, false);
  const auto bad = [] {
    return Error{ErrorCode::BadMessage, "Agones: /gameserver is no description of a game server"};
  };
  const auto word = [](const Json& object, const char* key) {
    const auto found = object.find(key);
    return found != object.end() && found->is_string() ? printable(found->get<std::string>(), 128)
                                                       : std::string();
  };
  if (!json.is_object() || !json.contains("object_meta") || !json["object_meta"].is_object())
    return bad();
  Place place{.name = word(json["object_meta"], "name"), .address = {}, .port = 0};
  if (!json.contains("status")) return place;
  const auto& status = json["status"];
  if (!status.is_object()) return bad();
  place.address = word(status, "address");
  const auto ports = status.find("ports");
  if (ports == status.end() || ports->is_null()) return place;
  if (!ports->is_array()) return bad();
  if (ports->empty()) return place;
  const auto& first = ports->front();
  if (!first.is_object() || !first.contains("port") || !first["port"].is_number_unsigned() ||
      first["port"].get<std::uint64_t>() > 65535)
    return bad();
  place.port = first["port"].get<std::uint16_t>();
  return place;
}

struct Sidecar::Core {
  asio::io_context& context;
  const std::uint16_t port;
  const std::function<std::string()> ill, not_ready;
  asio::steady_timer ready_timer, health_timer;
  bool is_stopping = false, is_ready = false, has_people = false, is_allocated = false;
  std::set<std::string> troubled;  // paths whose trouble is said

  Core(asio::io_context& io, std::uint16_t at, std::function<std::string()> is_ill,
       std::function<std::string()> is_not_ready)
      : context(io),
        port(at),
        ill(std::move(is_ill)),
        not_ready(std::move(is_not_ready)),
        ready_timer(io),
        health_timer(io) {}

  // Only the first trouble of a path is said, until that path is taken again.
  bool note(const char* path, const Status& status) {
    if (!status && troubled.insert(path).second)
      log::warn("Agones: {} at port {} was not taken ({}), it is said again", path, port,
                status.error().message);
    if (status) troubled.erase(path);
    return status.ok();
  }

  static asio::awaitable<void> wait(asio::steady_timer& timer, std::chrono::milliseconds span) {
    timer.expires_after(span);
    co_await timer.async_wait(kNoThrow);
  }

  // Until people may be sent here.
  static asio::awaitable<void> become_ready(std::shared_ptr<Core> core) {
    while (!core->is_stopping && !core->is_ready) {
      if (core->not_ready().empty()) {
        const auto answer = co_await http::ask(question(core->port, "POST", "/ready"));
        core->is_ready = core->note("/ready", taken(answer));
      }
      if (!core->is_ready) co_await wait(core->ready_timer, kRetry);
    }
    if (core->is_stopping) co_return;
    const auto answer = co_await http::ask(question(core->port, "GET", "/gameserver"));
    if (!answer) co_return;
    if (const auto place = read_place(answer->body); !place)
      log::warn("{}", place.error().message);
    else
      log::info("Agones: ready as {}, reached at {}:{}", place->name, place->address, place->port);
  }

  static asio::awaitable<void> stay_healthy(std::shared_ptr<Core> core) {
    while (!core->is_stopping) {
      if (core->ill().empty()) {
        const auto answer = co_await http::ask(question(core->port, "POST", "/health"));
        core->note("/health", taken(answer));
      }
      if (core->is_stopping) co_return;
      if (core->has_people && core->is_ready && !core->is_allocated) {
        const auto answer = co_await http::ask(question(core->port, "POST", "/allocate"));
        core->is_allocated = core->note("/allocate", taken(answer));
      }
      if (!core->is_stopping) co_await wait(core->health_timer, kHealthPeriod);
    }
  }
};

Sidecar::Sidecar(asio::io_context& context, std::uint16_t port, std::function<std::string()> ill,
                 std::function<std::string()> not_ready)
    : core_(std::make_shared<Core>(context, port, std::move(ill), std::move(not_ready))) {}

Sidecar::~Sidecar() {
  core_->is_stopping = true;
  core_->ready_timer.cancel();
  core_->health_timer.cancel();
}

void Sidecar::start() {
  spawn(core_->context.get_executor(), Core::become_ready(core_), rethrow);
  spawn(core_->context.get_executor(), Core::stay_healthy(core_), rethrow);
}

void Sidecar::set_people(std::size_t count) {
  const bool is_first = !core_->has_people && count > 0;
  core_->has_people |= count > 0;
  if (is_first) core_->health_timer.cancel();  // at once
}

Status shut_down(std::uint16_t port) {
  const auto said = taken(http::ask_and_wait(question(port, "POST", "/shutdown")));
  if (said) return {};
  return Error{said.error().code, "Agones: /shutdown was not taken: " + said.error().message};
}

}  // namespace trocar::agones
