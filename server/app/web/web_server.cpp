#include "server/app/web/web_server.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/ip/host_name.hpp>

#include "common/base/timing.h"
#include "common/http/web_socket.h"
#include "common/intake/acceptor.h"
#include "common/secure/digest.h"
#include "common/wire/framing.h"
#include "server/app/web/links.h"
#include "server/app/web/practice.h"
#include "server/app/web/recording_checks.h"
#include "server/session/access/try_limiter.h"
#include "server/session/monitoring/exposition.h"
#include "server/session/monitoring/figures_server.h"
#include "server/web/site/request_rules.h"

namespace trocar::app {
namespace {

using http::Request;
using Peer = intake::Acceptor::Peer;

constexpr std::chrono::seconds kRequestDeadline{10}, kAnswerDeadline{30};
constexpr std::size_t kPieceBytes = 64 * 1024;
// Old bytes wait in the kernel: few fit.
constexpr int kSendBufferBytes = 64 * 1024;
constexpr std::string_view kRecordingsPath = "/recordings", kLinksPath = "/links",
                           kPracticePath = "/practice";
constexpr unsigned kOk = 200, kPartialContent = 206, kNotModified = 304, kForbidden = 403,
                   kNotFound = 404, kMethodNotAllowed = 405, kRangeNotSatisfiable = 416,
                   kMisdirected = 421, kTooManyRequests = 429;

}  // namespace

struct WebServer::Core {
  // An answer whose body may be elsewhere.
  struct Answer : http::Answer {
    BytesView file;                                  // of the page
    std::unique_ptr<site::OpenRecording> recording;  // or a part of it
    site::ByteRange range;

    void set(std::string name, std::string value) {
      fields.emplace_back(std::move(name), std::move(value));
    }
  };

  const WebOptions options;
  WebContent content;
  const secure::TlsContext tls;
  page::Bridge bridge;
  intake::Acceptor acceptor;
  std::unique_ptr<monitoring::FiguresServer> figures;  // null: not asked for
  access::TryLimiter key_limiter;
  std::optional<RecordingChecks> checks;  // where there are recordings
  std::shared_ptr<Practice> practice;     // null: nobody practises here
  WebCounters counters;
  const std::string machine = asio::ip::host_name();
  bool is_stopping = false;

  Core(asio::io_context& io, const WebOptions& given, WebContent what, secure::TlsContext with)
      : options(given),
        content(std::move(what)),
        tls(std::move(with)),
        bridge(given.sessions, given.most_connections, given.most_per_address),
        acceptor(io, {.most = given.most_connections,
                      .most_per_address = given.most_per_address,
                      .time_to_speak = kRequestDeadline}) {
    if (content.recordings)
      checks.emplace(io, content.state_folder, std::chrono::seconds(given.check_limit_s));
  }

  // Whoever gets an answer knows that the program is well.
  Status open_figures(asio::io_context& context) {
    if (options.metrics_address.empty()) return {};
    auto listening = monitoring::FiguresServer::listen(
        context, options.metrics_address, options.metrics_port,
        {[] { return std::string(); },
         [this] { return std::string(is_stopping ? "the page ends" : ""); },
         [this] { return metrics(); }});
    if (!listening) return listening.error();
    figures = std::move(*listening);
    return {};
  }

  Status open_practice(asio::io_context& context) {
    if (options.practice.offer.empty()) return {};
    auto opened = Practice::open(context, options.practice, bridge);
    if (!opened) return opened.error();
    practice = std::move(*opened);
    return {};
  }

  asio::awaitable<void> serve(asio::ip::tcp::socket socket, std::unique_ptr<Peer> peer) {
    boost::system::error_code ignored;
    socket.set_option(asio::socket_base::send_buffer_size(kSendBufferBytes), ignored);
    http::Stream stream(std::move(socket), tls);
    peer->set_cut([&stream](auto) { stream.cut(); });
    if (tls)
      if (const auto failed = co_await stream.below().accept_tls()) co_return;
    bool goes_on = true;
    while (goes_on && !is_stopping) {
      Request request;
      peer->fall_silent();
      const auto read = co_await stream.read(request, {});
      peer->speak();
      if (read == http::Reading::Malformed || read == http::Reading::TooLong) ++counters.malformed;
      if (read != http::Reading::Whole) break;
      ++counters.requests;
      auto refusal = refusal_of(request);
      if (!refusal && asks_for_session(request)) {
        co_await bridge_to_session(stream, *peer, request);
        co_return;
      }
      if (refusal) request.keeps_alive = false;
      Answer answer = refusal ? std::move(*refusal) : answer_to(request, peer->address());
      goes_on = co_await send(stream, request, answer);
      goes_on = goes_on && request.keeps_alive;
    }
    stream.cut();
  }

  asio::awaitable<void> bridge_to_session(http::Stream& stream, Peer& peer,
                                          const Request& request) {
    auto socket =
        std::make_unique<http::WebSocket>(stream, peer.address(), wire::kMaxUpstreamBytes);
    const bool is_open = co_await socket->accept(request);
    if (!is_open) co_return;
    const auto watcher = std::make_shared<page::Watcher>(std::move(socket), bridge);
    peer.set_cut([watcher](auto) { watcher->cut(); });
    co_await watcher->run();
  }

  Answer make_answer(unsigned status, std::string type) {
    Answer answer;
    answer.status = status;
    answer.set("Content-Type", std::move(type));
    answer.set("Cache-Control", "no-cache");
    for (const auto& [name, value] : site::safety_headers(tls != nullptr))
      answer.set(std::string(name), std::string(value));
    return answer;
  }

  Answer refuse(unsigned status, std::string text) {
    if (status == kNotFound) ++counters.not_found;
    if (status == kForbidden || status == kMisdirected || status == kTooManyRequests)
      ++counters.forbidden;
    Answer answer = make_answer(status, "text/plain; charset=utf-8");
    answer.body = std::move(text);
    return answer;
  }

  Answer say(std::string json) {
    Answer answer = make_answer(kOk, "application/json");
    answer.body = std::move(json);
    return answer;
  }

  static bool asks_for_session(const Request& request) {
    return request.is_for_web_socket && request.target == "/session";
  }

  // Nothing: where it comes from is fine.
  std::optional<Answer> refusal_of(const Request& request) {
    const auto host = request.field("Host");
    if (!site::is_own_host(host, options.public_name, machine))
      return refuse(kMisdirected,
                    "This server has another name: ask whoever runs it for the right link.\n");
    if (asks_for_session(request) &&
        !site::is_own_origin(request.field("Origin"), host, tls != nullptr))
      return refuse(kForbidden, "Only the page of this server may open this.\n");
    return std::nullopt;
  }

  Answer answer_to(const Request& request, const std::string& peer) {
    if (request.method != "GET" && request.method != "HEAD") {
      Answer answer = refuse(kMethodNotAllowed, "Only GET and HEAD.\n");
      answer.set("Allow", "GET, HEAD");
      return answer;
    }
    const auto path = request.path();
    if (path == kPracticePath) return answer_practice(request, peer);
    if (path == kLinksPath) return answer_links(request, peer);
    if (path == kRecordingsPath ||
        (path.starts_with(kRecordingsPath) && path[kRecordingsPath.size()] == '/'))
      return answer_recordings(request, path.substr(kRecordingsPath.size()), peer);
    const auto* file = content.page.find(path);
    return file ? answer_file(request, *file) : refuse(kNotFound, "There is no such page.\n");
  }

  Answer answer_file(const Request& request, const site::PageFile& file) {
    Answer answer = make_answer(kOk, std::string(file.type));
    answer.set("ETag", file.etag);
    answer.set("Vary", "Accept-Encoding");
    if (request.field("If-None-Match") == file.etag) {
      answer.status = kNotModified;
      return answer;
    }
    const bool is_packed =
        !file.gzip.empty() && request.field("Accept-Encoding").find("gzip") != std::string::npos;
    if (is_packed) answer.set("Content-Encoding", "gzip");
    answer.file = is_packed ? BytesView(file.gzip) : BytesView(file.plain);
    answer.length = answer.file.size();
    return answer;
  }

  // Links to a session are for who leads it, from this page and now.
  Answer answer_links(const Request& request, const std::string& peer) {
    auto name = std::string_view(request.target).substr(kLinksPath.size());
    name = name.starts_with("?session=") ? name.substr(name.find('=') + 1) : "";
    const auto* session = bridge.sessions.find(std::string(name));
    const auto code = secure::parse_join_code(bearer_of(request));
    if (key_limiter.seconds_to_wait(peer, monotonic_ns()) > 0 || session == nullptr || !code ||
        !bridge.has_leader(session->name, *code)) {
      key_limiter.record_wrong_try(peer, monotonic_ns());
      return refuse(kForbidden, "Who leads the session has the links.\n");
    }
    return say(links_as_json(links_to(options, acceptor.port(), *session)));
  }

  Answer answer_practice(const Request& request, const std::string& peer) {
    const bool is_known = practice && key_limiter.seconds_to_wait(peer, monotonic_ns()) == 0 &&
                          secure::equal_in_constant_time(bytes_of(bearer_of(request)),
                                                         bytes_of(content.practice_key));
    if (!is_known) {
      key_limiter.record_wrong_try(peer, monotonic_ns());
      return refuse(kForbidden, "Practice needs the key of its link: ask for a new link.\n");
    }
    constexpr std::string_view kTicket = "?ticket=";
    auto ticket = std::string_view(request.target).substr(kPracticePath.size());
    ticket.remove_prefix(ticket.starts_with(kTicket) ? kTicket.size() : ticket.size());
    return say(practice->ask(std::string(ticket), intake::counted_as(peer)));
  }

  // Empty: the request names none.
  static std::string_view bearer_of(const Request& request) {
    constexpr std::string_view kScheme = "Bearer ";
    const auto given = request.field("Authorization");
    return given.starts_with(kScheme) ? given.substr(kScheme.size()) : std::string_view();
  }

  bool has_key(const Request& request) const {
    const auto given = bearer_of(request);
    return secure::equal_in_constant_time(bytes_of(given), bytes_of(content.recordings_key));
  }

  Answer answer_recordings(const Request& request, std::string_view rest, const std::string& peer) {
    if (!content.recordings)
      return refuse(kNotFound, "No recordings are served here: ask whoever runs the server.\n");
    if (const auto wait = key_limiter.seconds_to_wait(peer, monotonic_ns()); wait > 0)
      return refuse(kTooManyRequests, fmt::format("Too many wrong keys: wait {} s.\n", wait));
    if (!has_key(request)) {
      if (request.find("Authorization")) key_limiter.record_wrong_try(peer, monotonic_ns());
      return refuse(kForbidden, "Recordings need the key of their link: ask for a new link.\n");
    }
    if (rest.empty()) return say(content.recordings->list());
    const auto name = rest.substr(1, rest.find('/', 1) - 1);
    const auto about = rest.substr(1 + name.size());
    auto recording = content.recordings->find(name);
    if (!recording || !(about.empty() || about == "/check" || about == "/checked"))
      return refuse(kNotFound, "There is no such recording.\n");
    if (about.empty()) return answer_part(request, std::move(recording));
    return say(about == "/check" ? checks->ask(std::string(name), std::move(recording))
                                 : checks->known(std::string(name), *recording));
  }

  Answer answer_part(const Request& request, std::unique_ptr<site::OpenRecording> recording) {
    const auto size = recording->size();
    const auto asked = site::read_range(request.field("Range"), size);
    if (asked.kind == site::RangeKind::Unsatisfiable) {
      Answer answer = refuse(kRangeNotSatisfiable, "It ends before that.\n");
      answer.set("Content-Range", fmt::format("bytes */{}", size));
      return answer;
    }
    const bool is_part = asked.kind == site::RangeKind::Part;
    Answer answer = make_answer(is_part ? kPartialContent : kOk, "application/octet-stream");
    answer.set("Accept-Ranges", "bytes");
    answer.range = is_part ? asked.range : site::ByteRange{0, size};
    if (is_part)
      answer.set("Content-Range", fmt::format("bytes {}-{}/{}", answer.range.first,
                                              answer.range.first + answer.range.length - 1, size));
    answer.recording = std::move(recording);
    answer.length = answer.range.length;
    return answer;
  }

  asio::awaitable<bool> send(http::Stream& stream, const Request& request, const Answer& answer) {
    stream.end_after(kAnswerDeadline);
    bool goes_on = co_await stream.write(request, answer);
    const auto length = request.method == "HEAD" ? 0 : answer.length.value_or(0);
    std::string piece;
    for (std::uint64_t at = 0; goes_on && at < length; at += kPieceBytes) {
      const auto bytes =
          static_cast<std::size_t>(std::min<std::uint64_t>(kPieceBytes, length - at));
      BytesView part = answer.recording ? BytesView() : answer.file.subspan(at, bytes);
      if (answer.recording) {
        piece = answer.recording->read(answer.range.first + at, bytes);
        if (piece.size() < bytes) co_return false;  // it has become shorter: the answer breaks off
        part = bytes_of(piece);
        counters.recording_bytes += bytes;
      }
      stream.end_after(kAnswerDeadline);
      goes_on = co_await stream.write(part);
    }
    stream.end_never();
    co_return goes_on;
  }

  std::string metrics() const {
    const auto& b = bridge.counters;
    const auto& sessions = bridge.sessions;
    monitoring::Exposition text("trocar_web_");
    const auto number = [](std::uint64_t count) { return static_cast<double>(count); };
    text.gauge("connections_open", "Connections of browsers now.", acceptor.count());
    text.counter("connections_total", "Connections taken.", number(acceptor.counters().accepted));
    text.counter("connections_refused_total", "Connections beyond a limit.",
                 number(acceptor.counters().refused));
    text.counter("requests_total", "Requests read.", number(counters.requests));
    text.counter("requests_not_found_total", "Requests for what is not there.",
                 number(counters.not_found));
    text.counter("requests_forbidden_total", "Requests without key, or of another site.",
                 number(counters.forbidden));
    text.counter("requests_malformed_total", "Requests that are none.", number(counters.malformed));
    text.counter("recording_bytes_total", "Bytes of recordings sent.",
                 number(counters.recording_bytes));
    text.gauge("watchers", "People who watch a session now.", number(b.watchers));
    text.counter("joins_total", "Joins that reached a session.", number(b.joins));
    text.counter("joins_refused_total", "Joins refused here.", number(b.refused));
    text.counter("wrong_codes_total", "Wrong join codes.", number(b.wrong_codes));
    text.counter("sessions_unreachable_total", "Sessions that did not answer.",
                 number(b.unreachable));
    text.gauge("practising", "People who practise alone now.",
               practice ? static_cast<double>(practice->queue().practising()) : 0);
    text.gauge("practice_waiting", "People who wait for that.",
               practice ? static_cast<double>(practice->queue().waiting()) : 0);
    text.gauge("carriers", "Connections to sessions that many share, now.", number(b.carriers));
    text.counter("session_messages_total", "Messages from sessions.", number(sessions.messages));
    text.counter("session_bytes_total", "Bytes of these.", number(sessions.bytes));
    text.counter("frames_skipped_total", "Frames left out for those who share a connection.",
                 number(b.frames.frames_skipped));
    text.counter("messages_down_total", "Messages to browsers.", number(b.messages_down));
    text.counter("bytes_down_total", "Bytes of these.", number(b.bytes_down));
    text.counter("messages_up_total", "Messages from browsers.", number(b.messages_up));
    text.counter("bytes_up_total", "Bytes of these.", number(b.bytes_up));
    return text.text();
  }
};

Result<std::unique_ptr<WebServer>> WebServer::listen(asio::io_context& context,
                                                     const WebOptions& options, WebContent content,
                                                     secure::TlsContext tls) {
  auto core = std::make_shared<Core>(context, options, std::move(content), std::move(tls));
  if (auto opened = core->acceptor.open(options.address, options.port, "--listen"); !opened)
    return opened.error();
  if (auto opened = core->open_figures(context); !opened) return opened.error();
  if (auto opened = core->open_practice(context); !opened) return opened.error();
  return std::unique_ptr<WebServer>(new WebServer(std::move(core)));
}

WebServer::~WebServer() {
  stop();
}

std::uint16_t WebServer::port() const {
  return core_->acceptor.port();
}

std::uint16_t WebServer::metrics_port() const {
  return core_->figures ? core_->figures->port() : std::uint16_t{0};
}

void WebServer::start() {
  core_->acceptor.start([core = core_](auto socket, auto peer) {
    return core->serve(std::move(socket), std::move(peer));
  });
  if (core_->practice) core_->practice->start();
}

void WebServer::stop() {
  if (core_->is_stopping) return;
  core_->is_stopping = true;
  core_->acceptor.stop();
  if (core_->figures) core_->figures->stop();
  if (core_->checks) core_->checks->stop();
  if (core_->practice) core_->practice->stop();
  core_->acceptor.cut_all();
}

}  // namespace trocar::app
