#include "server/session/monitoring/figures_server.h"

#include <boost/asio/awaitable.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <optional>
#include <utility>

#include "server/session/monitoring/exposition.h"
#include "server/session/monitoring/http_acceptor.h"
#include "server/session/monitoring/http_stream.h"

namespace trocar::monitoring {
namespace {

namespace http = boost::beast::http;
using Request = http::request<http::empty_body>;

}  // namespace

struct FiguresServer::Core {
  const FiguresAnswers answers;
  HttpAcceptor acceptor;

  Core(asio::io_context& context, FiguresAnswers given)
      : answers(std::move(given)), acceptor(context, kMostConnections) {}

  asio::awaitable<void> serve(asio::ip::tcp::socket socket) {
    boost::system::error_code unknown;
    const auto peer = socket.remote_endpoint(unknown).address().to_string();
    HttpStream stream(std::move(socket), nullptr);
    stream.end_after(kDeadline);
    std::optional<HttpAcceptor::Newcomer> newcomer(
        std::in_place, acceptor, peer, [&stream] { stream.end_after(kDeadline.zero()); });
    http::request_parser<http::empty_body> parser;
    parser.header_limit(kMostHeaderBytes);
    const auto failed = co_await stream.read(parser, true);
    newcomer.reset();
    if (failed || acceptor.is_stopping()) co_return;
    const auto answer = answer_to(parser.get());
    const auto unsent = co_await stream.write(answer);
    if (!unsent) stream.shut_down();
  }

  HttpResponse answer_to(const Request& request) const {
    HttpResponse answer;
    answer.version(request.version());
    answer.keep_alive(false);
    answer.set(http::field::content_type, "text/plain; charset=utf-8");
    answer.set(http::field::cache_control, "no-store");
    answer.set("X-Content-Type-Options", "nosniff");
    fill(request, answer);
    answer.prepare_payload();
    return answer;
  }

  void fill(const Request& request, HttpResponse& answer) const {
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

  static void say(HttpResponse& answer, const std::string& trouble) {
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
      [at = core.get()](asio::ip::tcp::socket socket) { return at->serve(std::move(socket)); },
      core);
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
