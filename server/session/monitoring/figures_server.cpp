#include "server/session/monitoring/figures_server.h"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <exception>

#include "common/base/no_throw.h"
#include "server/session/monitoring/exposition.h"

namespace trocar::monitoring {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
using tcp = asio::ip::tcp;
using Request = http::request<http::empty_body>;
using Answer = http::response<http::string_body>;

constexpr std::chrono::milliseconds kAcceptRetry{200};

void rethrow(const std::exception_ptr& failure) {
  if (failure) std::rethrow_exception(failure);
}

}  // namespace

struct FiguresServer::Core : std::enable_shared_from_this<FiguresServer::Core> {
  asio::io_context& context;
  const FiguresAnswers answers;
  tcp::acceptor acceptor;
  std::size_t open = 0;
  bool is_stopping = false;

  Core(asio::io_context& io, FiguresAnswers given)
      : context(io), answers(std::move(given)), acceptor(io) {}

  asio::awaitable<void> accept(std::shared_ptr<Core> self) {
    asio::steady_timer retry(context);
    while (!is_stopping) {
      auto [error, socket] = co_await acceptor.async_accept(kNoThrow);
      if (is_stopping) co_return;
      if (error) {
        retry.expires_after(kAcceptRetry);
        co_await retry.async_wait(kNoThrow);
        continue;
      }
      if (open >= kMostConnections) continue;  // closes it
      ++open;
      asio::co_spawn(context, serve(beast::tcp_stream(std::move(socket))),
                     [self](const std::exception_ptr& failure) {
                       --self->open;
                       rethrow(failure);
                     });
    }
  }

  asio::awaitable<void> serve(beast::tcp_stream stream) {
    beast::flat_buffer buffer(2 * kMostHeaderBytes);
    http::request_parser<http::empty_body> parser;
    parser.header_limit(kMostHeaderBytes);
    stream.expires_after(kDeadline);
    const auto [failed, count] = co_await http::async_read_header(stream, buffer, parser, kNoThrow);
    if (failed || is_stopping) co_return;
    const Answer answer = answer_to(parser.get());
    const auto [unsent, bytes] = co_await http::async_write(stream, answer, kNoThrow);
    if (unsent) co_return;
    beast::error_code ignored;
    stream.socket().shutdown(tcp::socket::shutdown_send, ignored);
  }

  Answer answer_to(const Request& request) const {
    Answer answer;
    answer.version(request.version());
    answer.keep_alive(false);
    answer.set(http::field::content_type, "text/plain; charset=utf-8");
    answer.set(http::field::cache_control, "no-store");
    answer.set("X-Content-Type-Options", "nosniff");
    fill(request, answer);
    answer.prepare_payload();
    return answer;
  }

  void fill(const Request& request, Answer& answer) const {
    if (request.method() != http::verb::get) {
      answer.result(http::status::method_not_allowed);
      answer.set(http::field::allow, "GET");
      answer.body() = "Only GET.\n";
      return;
    }
    const auto path = request.target().substr(0, request.target().find('?'));
    if (path == "/healthz") return say(answer, answers.ill());
    if (path == "/readyz") return say(answer, answers.not_ready());
    if (path == "/metrics") {
      answer.set(http::field::content_type, kExpositionType);
      answer.body() = answers.metrics();
      return;
    }
    answer.result(http::status::not_found);
    answer.body() = "There are /healthz, /readyz and /metrics.\n";
  }

  static void say(Answer& answer, const std::string& trouble) {
    if (!trouble.empty()) answer.result(http::status::service_unavailable);
    answer.body() = (trouble.empty() ? "ok" : trouble) + "\n";
  }
};

Status check_figures_address(const std::string& address) {
  boost::system::error_code error;
  asio::ip::make_address(address, error);
  if (!error) return {};
  return Error{ErrorCode::Usage, "--metrics: '" + address +
                                     "' is not an IPv4 or IPv6 address: use 127.0.0.1 for this "
                                     "machine only"};
}

Result<std::unique_ptr<FiguresServer>> FiguresServer::listen(asio::io_context& context,
                                                             const std::string& address,
                                                             std::uint16_t port,
                                                             FiguresAnswers answers) {
  if (const auto checked = check_figures_address(address); !checked) return checked.error();
  boost::system::error_code error;
  const auto ip = asio::ip::make_address(address, error);
  const auto core = std::make_shared<Core>(context, std::move(answers));
  const tcp::endpoint endpoint(ip, port);
  auto& acceptor = core->acceptor;
  acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error)
    return Error{ErrorCode::ResourceMissing, "--metrics: " + address + ":" + std::to_string(port) +
                                                 ": " + error.message() + ", choose another port"};
  asio::co_spawn(context, core->accept(core), rethrow);
  return std::unique_ptr<FiguresServer>(new FiguresServer(core));
}

FiguresServer::FiguresServer(std::shared_ptr<Core> core) : core_(std::move(core)) {}

FiguresServer::~FiguresServer() {
  stop();
}

std::uint16_t FiguresServer::port() const {
  boost::system::error_code ignored;
  return core_->acceptor.local_endpoint(ignored).port();
}

void FiguresServer::stop() {
  core_->is_stopping = true;
  boost::system::error_code ignored;
  core_->acceptor.close(ignored);
}

}  // namespace trocar::monitoring
