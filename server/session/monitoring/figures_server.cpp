#include "server/session/monitoring/figures_server.h"

#include <boost/asio/awaitable.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>

#include "common/base/no_throw.h"
#include "server/session/monitoring/exposition.h"
#include "server/session/monitoring/http_acceptor.h"

namespace trocar::monitoring {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
using Request = http::request<http::empty_body>;
using Answer = http::response<http::string_body>;

}  // namespace

struct FiguresServer::Core {
  const FiguresAnswers answers;
  HttpAcceptor acceptor;

  Core(asio::io_context& context, FiguresAnswers given)
      : answers(std::move(given)), acceptor(context, kMostConnections) {}

  asio::awaitable<void> serve(beast::tcp_stream stream) {
    beast::flat_buffer buffer(2 * kMostHeaderBytes);
    http::request_parser<http::empty_body> parser;
    parser.header_limit(kMostHeaderBytes);
    stream.expires_after(kDeadline);
    const auto [failed, count] = co_await http::async_read_header(stream, buffer, parser, kNoThrow);
    if (failed || acceptor.is_stopping()) co_return;
    const Answer answer = answer_to(parser.get());
    const auto [unsent, bytes] = co_await http::async_write(stream, answer, kNoThrow);
    if (unsent) co_return;
    beast::error_code ignored;
    stream.socket().shutdown(asio::socket_base::shutdown_send, ignored);
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
  return check_address(address, "--metrics");
}

Result<std::unique_ptr<FiguresServer>> FiguresServer::listen(asio::io_context& context,
                                                             const std::string& address,
                                                             std::uint16_t port,
                                                             FiguresAnswers answers) {
  const auto core = std::make_shared<Core>(context, std::move(answers));
  if (const auto opened = core->acceptor.open(address, port, "--metrics"); !opened)
    return opened.error();
  core->acceptor.start(
      [at = core.get()](beast::tcp_stream stream) { return at->serve(std::move(stream)); }, core);
  return std::unique_ptr<FiguresServer>(new FiguresServer(core));
}

FiguresServer::FiguresServer(std::shared_ptr<Core> core) : core_(std::move(core)) {}

FiguresServer::~FiguresServer() {
  stop();
}

std::uint16_t FiguresServer::port() const {
  return core_->acceptor.port();
}

void FiguresServer::stop() {
  core_->acceptor.stop();
}

}  // namespace trocar::monitoring
