#include "server/app/web/web_server.h"

#include <fmt/format.h>
#include <algorithm>
#include <boost/asio/ip/host_name.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/http.hpp>
#include <map>
#include <set>

#include "common/base/log.h"
#include "common/base/spawn.h"
#include "common/base/timing.h"
#include "common/secure/digest.h"
#include "server/app/web/links.h"
#include "server/app/web/practice.h"
#include "server/app/web/recording_checks.h"
#include "server/app/web/web_socket.h"
#include "server/session/monitoring/exposition.h"
#include "server/session/monitoring/figures_server.h"
#include "server/web/site/request_rules.h"

namespace trocar::app {
namespace {

namespace http = beast::http;
using tcp = asio::ip::tcp;
using Request = http::request<http::string_body>;

constexpr std::chrono::seconds kRequestDeadline{10}, kAnswerDeadline{30}, kHandshakeDeadline{5};
constexpr std::chrono::milliseconds kAcceptRetry{200};
constexpr std::uint32_t kMostHeaderBytes = 8 * 1024;
constexpr std::size_t kPieceBytes = 64 * 1024;
// Old bytes wait in the kernel: few fit.
constexpr int kSendBufferBytes = 64 * 1024;
constexpr std::string_view kRecordingsPath = "/recordings", kLinksPath = "/links",
                           kPracticePath = "/practice";

// An answer: what goes before its body, and where the body is.
struct Answer {
  http::response_header<> head;
  BytesView body;                                  // of a file of the page
  std::string text;                                // else of what was made for it
  std::unique_ptr<site::OpenRecording> recording;  // else a part of a recording
  site::ByteRange range;
  std::uint64_t length = 0;
};

std::string plain_host(const tcp::socket& socket) {
  boost::system::error_code error;
  const auto peer = socket.remote_endpoint(error);
  return error ? std::string() : peer.address().to_string();
}

bool takes_gzip(const Request& request) {
  return request[http::field::accept_encoding].find("gzip") != beast::string_view::npos;
}

std::string_view view_of(beast::string_view text) {
  return {text.data(), text.size()};
}

}  // namespace

struct WebServer::Core : std::enable_shared_from_this<WebServer::Core> {
  asio::io_context& context;
  const WebOptions options;
  WebContent content;
  const secure::TlsContext tls;
  page::Bridge bridge;
  tcp::acceptor acceptor{context};
  std::unique_ptr<monitoring::FiguresServer> figures;  // null: not asked for
  access::TryLimiter key_limiter;
  std::optional<RecordingChecks> checks;  // where there are recordings
  std::shared_ptr<Practice> practice;     // null: nobody practises here
  WebCounters counters;
  access::Room room;  // for connections
  // Whoever is connected can be cut: by closing its socket, or its watcher.
  std::uint64_t next_id = 1;
  std::map<std::uint64_t, std::function<void()>> cuts;
  // Who has not asked for anything, or for nothing more: the oldest is cut where there is no room.
  std::map<std::uint64_t, std::string> silent;
  const std::string machine = asio::ip::host_name();
  bool is_stopping = false;

  Core(asio::io_context& io, const WebOptions& given, WebContent what, secure::TlsContext with)
      : context(io),
        options(given),
        content(std::move(what)),
        tls(std::move(with)),
        bridge(given.sessions, given.most_connections, given.most_per_address),
        room(given.most_connections, given.most_per_address) {
    if (content.recordings)
      checks.emplace(io, content.state_folder, std::chrono::seconds(given.check_limit_s));
  }

  Status open() {
    boost::system::error_code error;
    const auto ip = asio::ip::make_address(options.address, error);
    if (error)
      return Error{ErrorCode::Usage, "--listen: '" + options.address +
                                         "' is not an IPv4 or IPv6 address: use 127.0.0.1 for this "
                                         "machine only, 0.0.0.0 for any"};
    const tcp::endpoint endpoint(ip, options.port);
    acceptor.open(endpoint.protocol(), error);
    if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
    if (!error) acceptor.bind(endpoint, error);
    if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
    if (!error) return {};
    return Error{ErrorCode::ResourceMissing, "--listen: " + options.address + ":" +
                                                 std::to_string(options.port) + ": " +
                                                 error.message() + ", choose another port"};
  }

  std::uint16_t own_port() const {
    boost::system::error_code ignored;
    return acceptor.local_endpoint(ignored).port();
  }

  // Whoever gets an answer knows that the program is well.
  Status open_figures() {
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

  Status open_practice() {
    if (options.practice.offer.empty()) return {};
    auto opened = Practice::open(context, options.practice, bridge);
    if (!opened) return opened.error();
    practice = std::move(*opened);
    return {};
  }

  // Cuts the oldest who is silent, of that address or of the one that has most of these.
  bool make_room(const std::string& peer, bool is_of_same) {
    std::map<std::string, std::size_t> counts;
    std::size_t most = 0;
    for (const auto& [id, address] : silent) most = std::max(most, ++counts[address]);
    const auto oldest = std::ranges::find_if(silent, [&](const auto& one) {
      return is_of_same ? one.second == peer : counts[one.second] == most;
    });
    if (oldest == silent.end()) return false;
    const auto cut = cuts.at(oldest->first);
    silent.erase(oldest);
    cut();
    return true;
  }

  bool admit(const std::string& peer) {
    using Place = access::Room::Place;
    const auto place = room.place_for(peer);
    if (place != Place::Free && !make_room(access::counted_as(peer), place == Place::AddressFull)) {
      ++counters.refused_full;
      return false;
    }
    room.enter(peer);
    ++counters.connections;
    return true;
  }

  asio::awaitable<void> accept() {
    asio::steady_timer retry(context);
    while (!is_stopping) {
      auto [error, socket] = co_await acceptor.async_accept(kNoThrow);
      if (is_stopping) co_return;
      if (error) {
        retry.expires_after(kAcceptRetry);
        co_await retry.async_wait(kNoThrow);
        continue;
      }
      begin(std::move(socket));
    }
  }

  void begin(tcp::socket socket) {
    const auto peer = plain_host(socket);
    if (!admit(peer)) return;
    boost::system::error_code ignored;
    socket.set_option(tcp::no_delay(true), ignored);
    socket.set_option(asio::socket_base::send_buffer_size(kSendBufferBytes), ignored);
    const auto self = shared_from_this();
    const auto id = next_id++;
    const auto ended = [self, peer, id](std::exception_ptr failure) {
      self->silent.erase(id);
      self->room.leave(peer);
      rethrow(failure);
    };
    if (tls)
      spawn(context.get_executor(),
            serve_tls(
                beast::ssl_stream<beast::tcp_stream>(beast::tcp_stream(std::move(socket)), *tls),
                peer, id),
            ended);
    else
      spawn(context.get_executor(), serve(beast::tcp_stream(std::move(socket)), peer, id), ended);
  }

  asio::awaitable<void> serve_tls(beast::ssl_stream<beast::tcp_stream> stream, std::string peer,
                                  std::uint64_t id) {
    note_silent(id, peer, stream);
    beast::get_lowest_layer(stream).expires_after(kHandshakeDeadline);
    const auto [error] = co_await stream.async_handshake(asio::ssl::stream_base::server, kNoThrow);
    if (error) {
      cuts.erase(id);
      co_return;
    }
    co_await serve(std::move(stream), std::move(peer), id);
  }

  template <typename Stream>
  void note_silent(std::uint64_t id, const std::string& peer, Stream& stream) {
    cuts[id] = [&stream] { beast::get_lowest_layer(stream).close(); };
    silent[id] = access::counted_as(peer);
  }

  template <typename Stream>
  asio::awaitable<bool> read_request(Stream& stream, beast::flat_buffer& buffer, Request& request) {
    http::request_parser<http::string_body> parser;
    parser.header_limit(kMostHeaderBytes);
    parser.body_limit(0);
    beast::get_lowest_layer(stream).expires_after(kRequestDeadline);
    const auto [error, count] = co_await http::async_read(stream, buffer, parser, kNoThrow);
    if (error) {
      if (error.category() == http::make_error_code(http::error::bad_version).category() &&
          error != http::error::end_of_stream)
        ++counters.malformed;
      co_return false;
    }
    request = parser.release();
    ++counters.requests;
    co_return true;
  }

  template <typename Stream>
  asio::awaitable<void> serve(Stream stream, std::string peer, std::uint64_t id) {
    beast::flat_buffer buffer(kMostHeaderBytes + 4096);
    bool goes_on = true;
    while (goes_on && !is_stopping) {
      Request request;
      note_silent(id, peer, stream);
      const bool is_read = co_await read_request(stream, buffer, request);
      silent.erase(id);
      if (!is_read) break;
      if (!site::is_own_host(view_of(request[http::field::host]), options.public_name, machine)) {
        ++counters.forbidden;
        request.keep_alive(false);
        Answer refusal =
            refuse(request, http::status::misdirected_request,
                   "This server has another name: ask whoever runs it for the right link.\n");
        co_await send(stream, request, refusal);
        break;
      }
      if (beast::websocket::is_upgrade(request) && view_of(request.target()) == "/session") {
        const bool is_own =
            site::is_own_origin(view_of(request[http::field::origin]),
                                view_of(request[http::field::host]), tls != nullptr);
        if (is_own) {
          co_await bridge_to_session(std::move(stream), peer, request, id);
          cuts.erase(id);
          co_return;
        }
        ++counters.forbidden;
        request.keep_alive(false);
        Answer refusal = refuse(request, http::status::forbidden,
                                "Only the page of this server may open this.\n");
        co_await send(stream, request, refusal);
        break;
      }
      Answer answer = answer_to(request, peer);
      goes_on = co_await send(stream, request, answer);
      goes_on = goes_on && request.keep_alive();
    }
    cuts.erase(id);
    beast::get_lowest_layer(stream).close();
  }

  template <typename Stream>
  asio::awaitable<void> bridge_to_session(Stream stream, std::string peer, const Request& request,
                                          std::uint64_t id) {
    auto socket = std::make_unique<WebSocket<Stream>>(std::move(stream), peer);
    auto* below = socket.get();
    cuts[id] = [below] { below->cut(); };
    const bool is_open = co_await below->accept(request);
    if (!is_open) co_return;
    const auto watcher = std::make_shared<page::Watcher>(std::move(socket), bridge);
    cuts[id] = [watcher] { watcher->cut(); };
    co_await watcher->run();
  }

  Answer make_answer(const Request& request, http::status status, std::string_view type) {
    Answer answer;
    auto& head = answer.head;
    head.version(request.version());
    head.result(status);
    head.set(http::field::content_type, {type.data(), type.size()});
    head.set(http::field::cache_control, "no-cache");
    for (const auto& [name, value] : site::safety_headers(tls != nullptr))
      head.set({name.data(), name.size()}, {value.data(), value.size()});
    return answer;
  }

  Answer refuse(const Request& request, http::status status, std::string text) {
    Answer answer = make_answer(request, status, "text/plain; charset=utf-8");
    answer.text = std::move(text);
    answer.length = answer.text.size();
    return answer;
  }

  Answer answer_to(const Request& request, const std::string& peer) {
    if (request.method() != http::verb::get && request.method() != http::verb::head) {
      Answer answer = refuse(request, http::status::method_not_allowed, "Only GET and HEAD.\n");
      answer.head.set(http::field::allow, "GET, HEAD");
      return answer;
    }
    auto path = view_of(request.target());
    path = path.substr(0, path.find('?'));
    if (path == kPracticePath) return answer_practice(request, peer);
    if (path == kLinksPath) return answer_links(request, peer);
    if (path == kRecordingsPath ||
        (path.starts_with(kRecordingsPath) && path[kRecordingsPath.size()] == '/'))
      return answer_recordings(request, path.substr(kRecordingsPath.size()), peer);
    const auto* file = content.page.find(path);
    if (file == nullptr) {
      ++counters.not_found;
      return refuse(request, http::status::not_found, "There is no such page.\n");
    }
    return answer_file(request, *file);
  }

  Answer answer_file(const Request& request, const site::PageFile& file) {
    Answer answer = make_answer(request, http::status::ok, file.type);
    answer.head.set(http::field::etag, file.etag);
    answer.head.set(http::field::vary, "Accept-Encoding");
    if (view_of(request[http::field::if_none_match]) == file.etag) {
      answer.head.result(http::status::not_modified);
      return answer;
    }
    const bool is_packed = !file.gzip.empty() && takes_gzip(request);
    if (is_packed) answer.head.set(http::field::content_encoding, "gzip");
    answer.body = is_packed ? BytesView(file.gzip) : BytesView(file.plain);
    answer.length = answer.body.size();
    return answer;
  }

  // Links to a session are for who leads it, from this page and now.
  Answer answer_links(const Request& request, const std::string& peer) {
    auto name = view_of(request.target()).substr(kLinksPath.size());
    name = name.starts_with("?session=") ? name.substr(name.find('=') + 1) : "";
    const auto* session = bridge.sessions.find(std::string(name));
    const auto code = secure::parse_join_code(bearer_of(request));
    if (key_limiter.seconds_to_wait(peer, monotonic_ns()) > 0 || session == nullptr || !code ||
        !bridge.has_leader(session->name, *code)) {
      ++counters.forbidden;
      key_limiter.record_wrong_try(peer, monotonic_ns());
      return refuse(request, http::status::forbidden, "Who leads the session has the links.\n");
    }
    return answer_json(request, links_as_json(links_to(options, own_port(), *session)));
  }

  Answer answer_practice(const Request& request, const std::string& peer) {
    const bool is_known = practice && key_limiter.seconds_to_wait(peer, monotonic_ns()) == 0 &&
                          secure::equal_in_constant_time(bytes_of(bearer_of(request)),
                                                         bytes_of(content.practice_key));
    if (!is_known) {
      ++counters.forbidden;
      key_limiter.record_wrong_try(peer, monotonic_ns());
      return refuse(request, http::status::forbidden,
                    "Practice needs the key of its link: ask for a new link.\n");
    }
    constexpr std::string_view kTicket = "?ticket=";
    auto ticket = view_of(request.target()).substr(kPracticePath.size());
    ticket.remove_prefix(ticket.starts_with(kTicket) ? kTicket.size() : ticket.size());
    return answer_json(request, practice->ask(std::string(ticket), access::counted_as(peer)));
  }

  // Empty: the request names none.
  static std::string_view bearer_of(const Request& request) {
    constexpr std::string_view kScheme = "Bearer ";
    const auto given = view_of(request[http::field::authorization]);
    return given.starts_with(kScheme) ? given.substr(kScheme.size()) : std::string_view();
  }

  bool has_key(const Request& request) const {
    const auto given = bearer_of(request);
    return secure::equal_in_constant_time(bytes_of(given), bytes_of(content.recordings_key));
  }

  Answer answer_json(const Request& request, std::string text) {
    Answer answer = make_answer(request, http::status::ok, "application/json");
    answer.text = std::move(text);
    answer.length = answer.text.size();
    return answer;
  }

  Answer answer_recordings(const Request& request, std::string_view rest, const std::string& peer) {
    if (!content.recordings) {
      ++counters.not_found;
      return refuse(request, http::status::not_found,
                    "No recordings are served here: ask whoever runs the server.\n");
    }
    if (const auto wait = key_limiter.seconds_to_wait(peer, monotonic_ns()); wait > 0) {
      ++counters.forbidden;
      return refuse(request, http::status::too_many_requests,
                    "Too many wrong keys: wait " + std::to_string(wait) + " s.\n");
    }
    if (!has_key(request)) {
      ++counters.forbidden;
      if (request.find(http::field::authorization) != request.end())
        key_limiter.record_wrong_try(peer, monotonic_ns());
      return refuse(request, http::status::forbidden,
                    "Recordings need the key of their link: ask for a new link.\n");
    }
    if (rest.empty()) return answer_json(request, content.recordings->list());
    const auto name = rest.substr(1, rest.find('/', 1) - 1);
    const auto about = rest.substr(1 + name.size());
    auto recording = content.recordings->find(name);
    if (!recording || !(about.empty() || about == "/check" || about == "/checked")) {
      ++counters.not_found;
      return refuse(request, http::status::not_found, "There is no such recording.\n");
    }
    if (about.empty()) return answer_part(request, std::move(recording));
    return answer_json(request, about == "/check"
                                    ? checks->ask(std::string(name), std::move(recording))
                                    : checks->known(std::string(name), *recording));
  }

  Answer answer_part(const Request& request, std::unique_ptr<site::OpenRecording> recording) {
    const auto size = recording->size();
    const auto asked = site::read_range(view_of(request[http::field::range]), size);
    if (asked.kind == site::RangeKind::Unsatisfiable) {
      Answer answer =
          refuse(request, http::status::range_not_satisfiable, "It ends before that.\n");
      answer.head.set(http::field::content_range, fmt::format("bytes */{}", size));
      return answer;
    }
    const bool is_part = asked.kind == site::RangeKind::Part;
    Answer answer = make_answer(request, is_part ? http::status::partial_content : http::status::ok,
                                "application/octet-stream");
    answer.head.set(http::field::accept_ranges, "bytes");
    answer.range = is_part ? asked.range : site::ByteRange{0, size};
    if (is_part)
      answer.head.set(http::field::content_range,
                      fmt::format("bytes {}-{}/{}", answer.range.first,
                                  answer.range.first + answer.range.length - 1, size));
    answer.recording = std::move(recording);
    answer.length = answer.range.length;
    return answer;
  }

  template <typename Stream>
  asio::awaitable<bool> send(Stream& stream, const Request& request, Answer& answer) {
    http::response<http::empty_body> head(std::move(answer.head));
    head.content_length(answer.length);
    head.keep_alive(request.keep_alive());
    http::response_serializer<http::empty_body> serializer(head);
    beast::get_lowest_layer(stream).expires_after(kAnswerDeadline);
    const auto [failed, count] = co_await http::async_write_header(stream, serializer, kNoThrow);
    if (failed) co_return false;
    if (request.method() == http::verb::head) co_return true;
    std::uint64_t at = 0;
    std::string piece;
    while (at < answer.length) {
      const auto bytes =
          static_cast<std::size_t>(std::min<std::uint64_t>(kPieceBytes, answer.length - at));
      asio::const_buffer buffer(answer.body.data() + at, bytes);
      if (answer.recording) {
        piece = answer.recording->read(answer.range.first + at, bytes);
        if (piece.size() < bytes) co_return false;  // it has become shorter: the answer breaks off
        buffer = asio::buffer(piece);
        counters.recording_bytes += bytes;
      } else if (answer.body.empty()) {
        buffer = asio::const_buffer(answer.text.data() + at, bytes);
      }
      beast::get_lowest_layer(stream).expires_after(kAnswerDeadline);
      const auto [error, written] = co_await asio::async_write(stream, buffer, kNoThrow);
      if (error) co_return false;
      at += bytes;
    }
    co_return true;
  }

  std::string metrics() const {
    const auto& b = bridge.counters;
    const auto& sessions = bridge.sessions;
    monitoring::Exposition text("trocar_web_");
    const auto number = [](std::uint64_t count) { return static_cast<double>(count); };
    text.gauge("connections_open", "Connections of browsers now.",
               static_cast<double>(room.count()));
    text.counter("connections_total", "Connections taken.", number(counters.connections));
    text.counter("connections_refused_total", "Connections beyond a limit.",
                 number(counters.refused_full));
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
  for (const auto open : {&Core::open, &Core::open_figures, &Core::open_practice})
    if (auto opened = (*core.*open)(); !opened) return opened.error();
  return std::unique_ptr<WebServer>(new WebServer(std::move(core)));
}

WebServer::~WebServer() {
  stop();
}

std::uint16_t WebServer::port() const {
  return core_->own_port();
}

std::uint16_t WebServer::metrics_port() const {
  return core_->figures ? core_->figures->port() : std::uint16_t{0};
}

void WebServer::start() {
  const auto core = core_;
  spawn(core->context.get_executor(), core->accept(),
        [core](std::exception_ptr failure) { rethrow(failure); });
  if (core->practice) core->practice->start();
}

void WebServer::stop() {
  if (core_->is_stopping) return;
  core_->is_stopping = true;
  boost::system::error_code ignored;
  core_->acceptor.close(ignored);
  if (core_->figures) core_->figures->stop();
  if (core_->checks) core_->checks->stop();
  if (core_->practice) core_->practice->stop();
  auto cuts = core_->cuts;  // a copy: cutting takes entries out
  for (const auto& [id, cut] : cuts) cut();
}

}  // namespace trocar::app
