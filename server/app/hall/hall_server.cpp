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
#include "common/secure/digest.h"
#include "server/session/access/audit_log.h"
#include "server/session/monitoring/exposition.h"
#include "server/session/monitoring/http_acceptor.h"
#include "server/session/monitoring/http_stream.h"

namespace trocar::app {
namespace {

namespace http = boost::beast::http;
using Request = monitoring::HttpRequest;

constexpr std::chrono::milliseconds kEndPoll{100};
constexpr std::uint64_t kWrongProofNoteNs = 1'000'000'000;
constexpr std::string_view kBearer = "Bearer ";
constexpr std::string_view kSessions = "/sessions", kOneSession = "/sessions/";

enum class Trust : std::uint8_t { None, Wrong, Full };

struct Reply {
  http::status status = http::status::ok;
  std::string body, type = "application/json";
};

Reply reply(const Json& json, http::status status = http::status::ok) {
  return {.status = status, .body = to_text(json)};
}

Reply refusal(http::status status, const std::string& why) {
  return reply({{"error", why}}, status);
}

http::status status_of(const Error& error) {
  switch (error.code) {
    case ErrorCode::BadMessage:
      return http::status::bad_request;
    case ErrorCode::Refused:
      return http::status::conflict;
    default:
      return http::status::service_unavailable;
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
  hall::Sessions& sessions;
  const secure::Digest key;
  const secure::TlsContext tls;
  access::AuditLog audit;
  std::uint64_t wrong_proof_ns = 0;  // when one was last noted
  monitoring::HttpAcceptor acceptor;

  Core(asio::io_context& context, hall::Sessions& all, const std::string& secret,
       secure::TlsContext with, access::AuditLog log)
      : sessions(all),
        key(digest_of(secret)),
        tls(std::move(with)),
        audit(std::move(log)),
        acceptor(context, kMostConnections) {}

  // `what`: start, end or refusal.
  void note(const std::string& what, const std::string& name, const std::string& peer,
            const std::string& reason = {}) {
    audit.write({.event = what, .name = name, .role = "", .address = peer, .reason = reason});
  }

  asio::awaitable<void> serve(asio::ip::tcp::socket socket) {
    boost::system::error_code unknown;
    const auto peer = socket.remote_endpoint(unknown).address().to_string();
    monitoring::HttpStream stream(std::move(socket), tls);
    stream.end_after(kRequestDeadline);
    std::optional<monitoring::HttpAcceptor::Newcomer> newcomer(
        std::in_place, acceptor, peer, [&stream] { stream.end_after(kRequestDeadline.zero()); });
    if (tls)
      if (const auto failed = co_await stream.below().accept_tls()) co_return;
    http::request_parser<http::string_body> parser;
    parser.header_limit(kMostHeadBytes);
    parser.body_limit(hall::kMostRequestBytes);
    stream.end_after(kRequestDeadline);
    const auto failed = co_await stream.read(parser);
    newcomer.reset();
    stream.end_never();
    Reply given;
    if (failed == http::error::body_limit)
      given = refusal(http::status::payload_too_large, "the request is longer than 4096 bytes");
    else if (failed)
      co_return;
    else
      given = co_await answer_to(parser.get(), peer);
    monitoring::HttpResponse answer(given.status, parser.get().version());
    answer.keep_alive(false);
    answer.set(http::field::content_type, given.type);
    answer.set(http::field::cache_control, "no-store");
    answer.set("X-Content-Type-Options", "nosniff");
    if (given.status == http::status::unauthorized)
      answer.set(http::field::www_authenticate, "Bearer");
    answer.body() = std::move(given.body);
    answer.prepare_payload();
    stream.end_after(kRequestDeadline);
    const auto unsent = co_await stream.write(answer);
    if (!unsent) stream.shut_down();
  }

  Trust trust_in(const Request& request) const {
    const auto given = request[http::field::authorization];
    if (given.empty()) return Trust::None;
    if (!given.starts_with(kBearer)) return Trust::Wrong;
    const auto told = given.substr(kBearer.size());
    const bool is_key = secure::equal_in_constant_time(digest_of({told.data(), told.size()}), key);
    return is_key ? Trust::Full : Trust::Wrong;
  }

  asio::awaitable<Reply> answer_to(const Request& request, const std::string& peer) {
    const auto trust = trust_in(request);
    if (trust == Trust::Wrong) {
      note("refusal", "", peer, "the key is wrong");
      asio::steady_timer delay(acceptor.context(), kWrongKeyDelay);
      co_await delay.async_wait(kNoThrow);
      co_return refusal(http::status::unauthorized, "the key is wrong: name the hall's file of it");
    }
    const std::string path(request.target().data(), request.target().size());
    co_return co_await route(request.method(), path, request.body(), trust, peer);
  }

  asio::awaitable<Reply> route(http::verb method, std::string path, std::string body, Trust trust,
                               std::string peer) {
    if (method == http::verb::get) co_return get(path, trust == Trust::Full);
    const bool is_start = method == http::verb::post && path == kSessions;
    const bool is_end = method == http::verb::delete_ && path.starts_with(kOneSession);
    if (!is_start && !is_end)
      co_return refusal(http::status::method_not_allowed,
                        "there are GET and POST of /sessions, GET and DELETE of /sessions/NAME");
    if (trust != Trust::Full)
      co_return refusal(http::status::unauthorized, "this needs the hall's key");
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
    Reply given;
    if (proof == hall::Proof::Wrong) {
      const auto now = monotonic_ns();
      if (wrong_proof_ns == 0 || now - wrong_proof_ns >= kWrongProofNoteNs) {
        wrong_proof_ns = now;
        note("refusal", "", "bus", "the proof is wrong");
      }
      given =
          refusal(http::status::unauthorized,
                  "the key is wrong, the clocks of both machines differ by a minute, or the hall "
                  "has only just started");
    } else if (request.body.size() > hall::kMostRequestBytes) {
      given = refusal(http::status::payload_too_large, "the request is longer than 4096 bytes");
    } else {
      const auto trust = proof == hall::Proof::Right ? Trust::Full : Trust::None;
      given = co_await route(http::string_to_verb(request.method), request.path, request.body,
                             trust, "bus");
    }
    answer(Json{{"status", static_cast<int>(given.status)}, {"body", given.body}}.dump(
        -1, ' ', false, Json::error_handler_t::replace));
  }

  Reply get(const std::string& path, bool is_trusted) const {
    if (path == "/healthz") return {.body = "ok\n", .type = "text/plain; charset=utf-8"};
    if (path == "/metrics")
      return {.body = exposition(sessions), .type = monitoring::kExpositionType};
    const auto& config = sessions.config();
    if (path == kSessions) return reply(directory(is_trusted));
    if (path.starts_with(kOneSession))
      if (const auto session = sessions.find(path.substr(kOneSession.size())))
        return reply(hall::describe(*session, config, is_trusted));
    return refusal(http::status::not_found, "there is no " + printable(path, 64) +
                                                ": ask for /sessions, /healthz or /metrics");
  }

  Reply start(const std::string& body, const std::string& peer) {
    if (acceptor.is_stopping()) return refusal(http::status::service_unavailable, "the hall ends");
    const auto request = hall::parse_start_request(body);
    if (!request) return refusal(status_of(request.error()), request.error().message);
    const auto started = sessions.start(*request);
    if (!started) {
      note("refusal", request->name, peer, started.error().message);
      return refusal(status_of(started.error()), started.error().message);
    }
    note("start", (*started)->name, peer);
    return reply(hall::describe(**started, sessions.config(), true), http::status::created);
  }

  asio::awaitable<Reply> end(std::string name, std::string peer) {
    const auto ended = sessions.end(name);
    if (!ended) co_return refusal(http::status::not_found, ended.error().message);
    note("end", name, peer);
    const auto session = *ended;
    const auto deadline = std::chrono::steady_clock::now() + kEndDeadline;
    asio::steady_timer timer(acceptor.context());
    while (session->state != hall::SessionState::Ended &&
           std::chrono::steady_clock::now() < deadline) {
      timer.expires_after(kEndPoll);
      co_await timer.async_wait(kNoThrow);
    }
    const bool has_ended = session->state == hall::SessionState::Ended;
    co_return reply(hall::describe(*session, sessions.config(), true),
                    has_ended ? http::status::ok : http::status::accepted);
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
      [at = core.get()](asio::ip::tcp::socket socket) { return at->serve(std::move(socket)); },
      core);
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
  spawn(core_->acceptor.context().get_executor(),
        core_->answer_bus(request, proof, std::move(answer)),
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
