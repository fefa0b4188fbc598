#include "server/app/web/practice.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

#include "common/base/log.h"
#include "common/base/no_throw.h"
#include "common/base/printable.h"
#include "common/base/spawn.h"
#include "common/base/timing.h"
#include "common/secure/digest.h"
#include "common/secure/private_files.h"

namespace trocar::app {
namespace {

constexpr std::chrono::milliseconds kPeriod{500};
constexpr std::chrono::seconds kAnswer{5}, kEndAnswer{40};
constexpr double kRetry_s = 15, kStart_s = 60;
constexpr std::size_t kTicketBytes = 16, kNameBytes = 4;
constexpr unsigned kCreated = 201, kConflict = 409;
constexpr const char* kPrefix = "practice-";

double now_s() {
  return static_cast<double>(monotonic_ns()) * 1e-9;
}

std::string random_hex(std::size_t bytes) {
  std::array<std::uint8_t, kTicketBytes> random{};
  secure::fill_random(random);
  return secure::to_hex(std::span(random).first(bytes));
}

std::string text_of(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

// "HOST:PORT", as a hall says it.
std::optional<follow::SessionAddress> address_of(const Json& session) {
  const auto text = text_of(session, "address");
  const auto colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) return std::nullopt;
  follow::SessionAddress place{text, text.substr(0, colon), 0};
  if (place.host.starts_with('[') && place.host.ends_with(']'))
    place.host = place.host.substr(1, place.host.size() - 2);
  const int port = std::atoi(text.c_str() + colon + 1);
  if (port <= 0 || port > 65'535) return std::nullopt;
  place.port = static_cast<std::uint16_t>(port);
  return place;
}

std::string surgeon_code(const Json& session) {
  const auto codes = session.find("codes");
  return codes != session.end() && codes->is_object() ? text_of(*codes, "surgeon") : std::string();
}

// The line with which a hall refuses.
std::string words_of(const Result<http::Answer>& answer) {
  if (!answer) return "the hall does not answer: " + answer.error().message;
  const auto json = Json::parse(answer->body, nullptr, false);
  const auto words = json.is_object() ? text_of(json, "error") : std::string();
  return words.empty() ? fmt::format("the hall says {}", answer->status) : printable(words, 300);
}

}  // namespace

Result<std::shared_ptr<Practice>> Practice::open(asio::io_context& context,
                                                 const PracticeOptions& options,
                                                 page::Bridge& bridge) {
  auto key = secure::read_private_file(options.key_file);
  if (!key) return Error{key.error().code, "--hall-key: " + key.error().message};
  while (key->ends_with('\n') || key->ends_with('\r')) key->pop_back();
  return std::shared_ptr<Practice>(new Practice(context, options, std::move(*key), bridge));
}

Practice::Practice(asio::io_context& context, const PracticeOptions& options, std::string key,
                   page::Bridge& bridge)
    : context_(context),
      options_(options),
      key_(std::move(key)),
      bridge_(bridge),
      queue_({.longest_s = 60.0 * options.minutes, .idle_s = double(options.idle_s)}),
      timer_(context) {}

void Practice::start() {
  const auto self = shared_from_this();
  spawn(context_.get_executor(), run(), [self](std::exception_ptr failure) { rethrow(failure); });
}

void Practice::stop() {
  is_stopping_ = true;
  timer_.cancel();
  for (const auto& name : queue_.end_all("The page has ended.", now_s())) end_at_hall(name);
}

std::string Practice::ask(const std::string& ticket, const std::string& address) {
  const auto now = now_s();
  const auto* visitor = queue_.ask(ticket, random_hex(kTicketBytes), address, now);
  if (visitor == nullptr) return Json{{"state", "full"}}.dump();
  Json json{{"ticket", visitor->ticket}};
  switch (visitor->step) {
    case practice::Step::Waiting: {
      json["state"] = "waiting";
      json["number"] = queue_.number_of(*visitor);
      const auto wait = queue_.wait_s(*visitor, now);
      json["wait_s"] = wait ? Json(*wait) : Json();
      break;
    }
    case practice::Step::Starting:
      json["state"] = "starting";
      break;
    case practice::Step::Practising:
      json["state"] = "ready";
      json["session"] = visitor->session;
      json["code"] = visitor->code;
      json["left_s"] = queue_.left_s(*visitor, now);
      break;
    case practice::Step::Over:
      json["state"] = "over";
      json["why"] = visitor->why;
      break;
  }
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

// Coroutines here hold no temporaries across a co_await: GCC 12 miscompiles some of them otherwise.
asio::awaitable<void> Practice::run() {
  co_await end_left_over();
  while (!is_stopping_) {
    timer_.expires_after(kPeriod);
    co_await timer_.async_wait(kNoThrow);
    if (is_stopping_) break;
    const auto over = queue_.end_those_over(
        now_s(), [this](const std::string& session) { return use_of(session); });
    for (const auto& name : over) end_at_hall(name);
    if (now_s() >= retry_at_s_) co_await begin_one();
  }
}

asio::awaitable<Practice::Answer> Practice::ask_hall(std::string method, std::string path,
                                                     std::string body) {
  http::Question question;
  question.host = options_.hall_host;
  question.port = options_.hall_port;
  question.deadline = method == "DELETE" ? kEndAnswer : kAnswer;
  question.method = std::move(method);
  question.path = std::move(path);
  question.body = std::move(body);
  question.key = key_;
  auto answer = co_await http::ask(std::move(question));
  co_return answer;
}

asio::awaitable<void> Practice::end_left_over() {
  const auto answer = co_await ask_hall("GET", "/sessions", "");
  const auto json = answer ? Json::parse(answer->body, nullptr, false) : Json();
  const auto sessions = json.is_object() ? json.find("sessions") : json.end();
  if (!json.is_object() || sessions == json.end() || !sessions->is_array()) {
    log::warn("--practice: {}; it is tried again", words_of(answer));
    co_return;
  }
  const auto offers = json.find("may_start");
  if (offers != json.end() && std::ranges::find(*offers, Json(options_.offer)) == offers->end())
    log::error("--practice: the hall does not offer {}, which nobody can begin: name one of {}",
               options_.offer, printable(offers->dump(), 300));
  for (const auto& session : *sessions) {
    const auto people = session.find("people");
    const bool is_empty = people != session.end() && people->is_number() && *people == 0;
    if (const auto name = text_of(session, "name"); name.starts_with(kPrefix) && is_empty)
      end_at_hall(name);
  }
}

asio::awaitable<void> Practice::begin_one() {
  auto* next = queue_.begin_next(now_s());
  if (next == nullptr) co_return;
  const std::string ticket = next->ticket, name = kPrefix + random_hex(kNameBytes);
  next->name = name;
  std::string body = Json{{"start", options_.offer}, {"name", name}}.dump();
  const auto answer = co_await ask_hall("POST", "/sessions", std::move(body));
  if (answer && answer->status == kCreated) {
    co_await await_session(ticket, name);
    co_return;
  }
  queue_.put_back(ticket);
  retry_at_s_ = now_s() + kRetry_s;
  const auto words = words_of(answer);
  const bool has_no_room = answer && answer->status == kConflict;
  if (std::exchange(told_, words) == words) co_return;
  if (has_no_room)
    log::info("practice: {} wait: {}", queue_.waiting(), words);
  else
    log::warn("--practice: {}", words);
}

// A hall answers before its server runs.
asio::awaitable<void> Practice::await_session(std::string ticket, std::string name) {
  const double until = now_s() + kStart_s;
  const std::string path = "/sessions/" + name;
  while (!is_stopping_ && now_s() < until) {
    const auto answer = co_await ask_hall("GET", path, "");
    const auto json = answer ? Json::parse(answer->body, nullptr, false) : Json();
    const auto state = json.is_object() ? text_of(json, "state") : std::string();
    const auto place = json.is_object() ? address_of(json) : std::nullopt;
    const auto code = json.is_object() ? surgeon_code(json) : std::string();
    if (state == "running" && place && !code.empty()) {
      bridge_.sessions.add(*place);
      queue_.set_running(ticket, place->name, code, now_s());
      log::info("practice: {} begins, {} wait", name, queue_.waiting());
      told_.clear();
      co_return;
    }
    if (state != "starting" && state != "running") break;
    timer_.expires_after(kPeriod);
    co_await timer_.async_wait(kNoThrow);
  }
  if (!is_stopping_) fail(ticket, name);
}

void Practice::fail(const std::string& ticket, const std::string& name) {
  log::warn("practice: {} did not begin: see the hall's log", name);
  queue_.put_back(ticket);
  retry_at_s_ = now_s() + kRetry_s;
  end_at_hall(name);
}

void Practice::end_at_hall(const std::string& name) {
  const auto self = shared_from_this();
  spawn(context_.get_executor(), end_one(name),
        [self](std::exception_ptr failure) { rethrow(failure); });
}

asio::awaitable<void> Practice::end_one(std::string name) {
  const auto self = shared_from_this();
  const std::string path = "/sessions/" + name;
  const auto answer = co_await ask_hall("DELETE", path, "");
  const auto json = answer ? Json::parse(answer->body, nullptr, false) : Json();
  const auto place = json.is_object() ? address_of(json) : std::nullopt;
  if (place) {
    bridge_.sessions.remove(place->name);
    bridge_.uses.erase(place->name);
    log::info("practice: {} has ended", name);
  } else {
    log::warn("practice: {} cannot be ended: {}", name, words_of(answer));
  }
  retry_at_s_ = 0;  // there is room again
}

practice::Use Practice::use_of(const std::string& session) const {
  const auto found = bridge_.uses.find(session);
  if (found == bridge_.uses.end()) return {};
  return {.people = found->second->people,
          .deed_s = static_cast<double>(found->second->deed_ns) * 1e-9};
}

}  // namespace trocar::app
