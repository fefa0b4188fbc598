#include "server/app/hall/hall_server.h"

#include <fmt/format.h>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>
#include <map>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/json.h"
#include "common/base/no_throw.h"
#include "common/base/printable.h"
#include "common/base/spawn.h"
#include "common/base/timing.h"
#include "common/http/stream.h"
#include "common/intake/acceptor.h"
#include "common/secure/digest.h"
#include "server/session/access/audit_log.h"
#include "server/session/monitoring/exposition.h"

namespace trocar::app {
namespace {

constexpr std::chrono::milliseconds kEndPoll{100};
constexpr std::uint64_t kWrongProofNoteNs = 1'000'000'000;
constexpr std::string_view kBearer = "Bearer ";
constexpr std::string_view kSessions = "/sessions", kOneSession = "/sessions/";

constexpr unsigned kOk = 200, kCreated = 201, kAccepted = 202, kBadRequest = 400,
                   kUnauthorized = 401, kNotFound = 404, kMethodNotAllowed = 405, kConflict = 409,
                   kTooLarge = 413, kUnavailable = 503;

http::Answer answer_of(unsigned status, std::string type, std::string body) {
  return {.status = status,
          .fields = {{"Content-Type", std::move(type)},
                     {"Cache-Control", "no-store"},
                     {"X-Content-Type-Options", "nosniff"}},
          .body = std::move(body)};
}

http::Answer reply(const Json& json, unsigned status = kOk) {
  return answer_of(status, "application/json", to_text(json));
}

http::Answer refusal(unsigned status, const std::string& why) {
  auto answer = reply({{"error", why}}, status);
  if (status == kUnauthorized) answer.fields.emplace_back("WWW-Authenticate", "Bearer");
  return answer;
}

unsigned status_of(const Error& error) {
  switch (error.code) {
    case ErrorCode::BadMessage:
      return kBadRequest;
    case ErrorCode::Refused:
      return kConflict;
    default:
      return kUnavailable;
  }
}

secure::Digest digest_of(std::string_view text) {
  return secure::sha256({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

std::string exposition(const hall::Sessions& sessions) {
  std::map<std::string, double> by_state;
  std::vector<monitoring::Labelled> people, rate, cores, silence;
  for (const auto& session : sessions.list()) {
    ++by_state[hall::name_of(session->state)];
    people.emplace_back(session->name, session->figures.people);
    rate.emplace_back(session->name, session->figures.time_rate);
    cores.emplace_back(session->name, session->cores);
    silence.emplace_back(session->name, hall::silence_s(*session));
  }
  std::vector<monitoring::Labelled> states;
  for (const auto* state : {"starting", "running", "ending", "failed"})
    states.emplace_back(state, by_state[state]);
  const auto& counters = sessions.counters();
  const auto count = [](std::uint64_t number) { return static_cast<double>(number); };
  monitoring::Exposition text("trocar_hall_");
  text.gauges("sessions", "Sessions by state.", "state", states);
  text.gauge("sessions_most", "Sessions that may run.", sessions.config().most_sessions);
  text.gauge("cores", "Cores that sessions may take together.", sessions.config().cores);
  text.gauge("cores_taken", "Cores that are counted as taken.", sessions.taken_cores());
  text.counter("started_total", "Sessions that were started.", count(counters.started));
  text.counter("refused_total", "Requests to start one that were refused.",
               count(counters.refused));
  text.counter("restarted_total", "Starts from a recording after a server was killed.",
               count(counters.restarted));
  text.counter("failed_total", "Sessions that have failed.", count(counters.failed));
  text.gauges("session_people", "People in a session.", "session", people);
  text.gauges("session_time_rate", "Simulated time over real time of a session.", "session", rate);
  text.gauges("session_cores", "Processor seconds per second of a session.", "session", cores);
  text.gauges("session_silence_seconds", "Time since a running session has last answered.",
              "session", silence);
  return text.text();
}

}  // namespace

struct HallServer::Core {
  enum class Trust : std::uint8_t { None, Wrong, Full };

  asio::io_context& context;
  hall::Sessions& sessions;
  const secure::Digest key;
  const secure::TlsContext tls;
  access::AuditLog audit;
  std::uint64_t wrong_proof_ns = 0;  // when one was last noted
  intake::Acceptor acceptor;

  Core(asio::io_context& io, hall::Sessions& all, const std::string& secret,
       secure::TlsContext with, access::AuditLog log)
      : context(io),
        sessions(all),
        key(digest_of(secret)),
        tls(std::move(with)),
        audit(std::move(log)),
        acceptor(io, {.most = kMostConnections, .time_to_speak = kRequestDeadline}) {}

  // `what`: start, end or refusal.
  void note(const std::string& what, const std::string& name, const std::string& peer,
            const std::string& reason = {}) {
    audit.write({.event = what, .name = name, .role = "", .address = peer, .reason = reason});
  }

  asio::awaitable<void> serve(asio::ip::tcp::socket socket,
                              std::unique_ptr<intake::Acceptor::Peer> peer) {
    http::Stream stream(std::move(socket), tls);
    peer->set_cut([&stream](auto) { stream.cut(); });
    if (tls)
      if (const auto failed = co_await stream.below().accept_tls()) co_return;
    http::Request request;
    const http::MessageLimits limits{kMostHeadBytes, hall::kMostRequestBytes};
    const auto read = co_await stream.read(request, limits);
    peer->speak();
    http::Answer answer;
    if (read == http::Reading::TooLong)
      answer = refusal(kTooLarge, "the request is longer than 4096 bytes");
    else if (read != http::Reading::Whole)
      co_return;
    else
      answer = co_await answer_to(request, peer->address());
    request.keeps_alive = false;
    stream.end_after(kRequestDeadline);
    const bool is_sent = co_await stream.write(request, answer);
    if (is_sent) stream.shut_down();
  }

  Trust trust_in(const http::Request& request) const {
    const auto given = request.field("Authorization");
    if (given.empty()) return Trust::None;
    if (!given.starts_with(kBearer)) return Trust::Wrong;
    const bool is_key =
        secure::equal_in_constant_time(digest_of(given.substr(kBearer.size())), key);
    return is_key ? Trust::Full : Trust::Wrong;
  }

  asio::awaitable<http::Answer> answer_to(const http::Request& request, const std::string& peer) {
    const auto trust = trust_in(request);
    if (trust == Trust::Wrong) {
      note("refusal", "", peer, "the key is wrong");
      asio::steady_timer delay(context, kWrongKeyDelay);
      co_await delay.async_wait(kNoThrow);
      co_return refusal(kUnauthorized, "the key is wrong: name the hall's file of it");
    }
    co_return co_await route(request.method, request.target, request.body, trust, peer);
  }

  asio::awaitable<http::Answer> route(std::string method, std::string path, std::string body,
                                      Trust trust, std::string peer) {
    if (method == "GET") co_return get(path, trust == Trust::Full);
    const bool is_start = method == "POST" && path == kSessions;
    const bool is_end = method == "DELETE" && path.starts_with(kOneSession);
    if (!is_start && !is_end)
      co_return refusal(kMethodNotAllowed,
                        "there are GET and POST of /sessions, GET and DELETE of /sessions/NAME");
    if (trust != Trust::Full) co_return refusal(kUnauthorized, "this needs the hall's key");
    if (is_start) co_return start(body, peer);
    co_return co_await end(path.substr(kOneSession.size()), peer);
  }

  Json directory(bool is_trusted) const {
    const auto& config = sessions.config();
    Json json{{"sessions", Json::array()}};
    for (const auto& session : sessions.list())
      json["sessions"].push_back(hall::describe(*session, config, is_trusted));
    json["cores"] = config.cores;
    json["cores_taken"] = sessions.taken_cores();
    json["sessions_most"] = config.most_sessions;
    json["may_start"] = Json::array();
    for (const auto& offer : config.offers) json["may_start"].push_back(offer.name);
    return json;
  }

  // Answers one request that came over a bus.
  asio::awaitable<void> answer_bus(hall::BusRequest request, hall::Proof proof,
                                   std::function<void(const std::string&)> answer) {
    http::Answer given;
    if (proof == hall::Proof::Wrong) {
      const auto now = monotonic_ns();
      if (wrong_proof_ns == 0 || now - wrong_proof_ns >= kWrongProofNoteNs) {
        wrong_proof_ns = now;
        note("refusal", "", "bus", "the proof is wrong");
      }
      given =
          refusal(kUnauthorized,
                  "the key is wrong, the clocks of both machines differ by a minute, or the hall "
                  "has only just started");
    } else if (request.body.size() > hall::kMostRequestBytes) {
      given = refusal(kTooLarge, "the request is longer than 4096 bytes");
    } else {
      const auto trust = proof == hall::Proof::Right ? Trust::Full : Trust::None;
      given = co_await route(request.method, request.path, request.body, trust, "bus");
    }
    answer(Json{{"status", given.status}, {"body", given.body}}.dump(
        -1, ' ', false, Json::error_handler_t::replace));
  }

  http::Answer get(const std::string& path, bool is_trusted) const {
    if (path == "/healthz") return answer_of(kOk, "text/plain; charset=utf-8", "ok\n");
    if (path == "/metrics")
      return answer_of(kOk, monitoring::kExpositionType, exposition(sessions));
    const auto& config = sessions.config();
    if (path == kSessions) return reply(directory(is_trusted));
    if (path.starts_with(kOneSession))
      if (const auto session = sessions.find(path.substr(kOneSession.size())))
        return reply(hall::describe(*session, config, is_trusted));
    return refusal(kNotFound, "there is no " + printable(path, 64) +
                                  ": ask for /sessions, /healthz or /metrics");
  }

  http::Answer start(const std::string& body, const std::string& peer) {
    if (acceptor.is_stopping()) return refusal(kUnavailable, "the hall ends");
    const auto request = hall::parse_start_request(body);
    if (!request) return refusal(status_of(request.error()), request.error().message);
    const auto started = sessions.start(*request);
    if (!started) {
      note("refusal", request->name, peer, started.error().message);
      return refusal(status_of(started.error()), started.error().message);
    }
    note("start", (*started)->name, peer);
    return reply(hall::describe(**started, sessions.config(), true), kCreated);
  }

  asio::awaitable<http::Answer> end(std::string name, std::string peer) {
    const auto ended = sessions.end(name);
    if (!ended) co_return refusal(kNotFound, ended.error().message);
    note("end", name, peer);
    const auto session = *ended;
    const auto deadline = std::chrono::steady_clock::now() + kEndDeadline;
    asio::steady_timer timer(context);
    while (session->state != hall::SessionState::Ended &&
           std::chrono::steady_clock::now() < deadline) {
      timer.expires_after(kEndPoll);
      co_await timer.async_wait(kNoThrow);
    }
    const bool has_ended = session->state == hall::SessionState::Ended;
    co_return reply(hall::describe(*session, sessions.config(), true), has_ended ? kOk : kAccepted);
  }
};

Result<std::unique_ptr<HallServer>> HallServer::listen(asio::io_context& context,
                                                       hall::Sessions& sessions, std::string key,
                                                       secure::TlsContext tls) {
  const auto& config = sessions.config();
  auto audit = access::AuditLog::open(config.state_folder / "audit.jsonl");
  if (!audit) return audit.error();
  const auto core =
      std::make_shared<Core>(context, sessions, key, std::move(tls), std::move(*audit));
  if (const auto opened = core->acceptor.open(config.address, config.port, "listen"); !opened)
    return opened.error();
  core->acceptor.start(
      [core](auto socket, auto peer) { return core->serve(std::move(socket), std::move(peer)); });
  return std::unique_ptr<HallServer>(new HallServer(core));
}

HallServer::HallServer(std::shared_ptr<Core> core) : core_(std::move(core)) {}

HallServer::~HallServer() {
  stop();
}

std::uint16_t HallServer::port() const {
  return core_->acceptor.port();
}

void HallServer::answer(const hall::BusRequest& request, hall::Proof proof,
                        std::function<void(const std::string&)> answer) {
  spawn(core_->context.get_executor(), core_->answer_bus(request, proof, std::move(answer)),
        [core = core_](std::exception_ptr failure) { rethrow(failure); });
}

std::string HallServer::directory(const std::string& hall_name, const std::string& start) const {
  auto json = core_->directory(false);
  json["hall"] = hall_name;
  json["start"] = start;
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

void HallServer::stop() {
  core_->acceptor.stop();
}

}  // namespace trocar::app
