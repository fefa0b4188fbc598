#include "server/session/monitoring/figures_server.h"

#include <boost/asio/awaitable.hpp>
#include <utility>

#include "common/http/stream.h"
#include "common/intake/acceptor.h"
#include "server/session/monitoring/exposition.h"

namespace trocar::monitoring {

struct FiguresServer::Core {
  const FiguresAnswers answers;
  intake::Acceptor acceptor;

  Core(asio::io_context& context, FiguresAnswers given)
      : answers(std::move(given)),
        acceptor(context, {.most = kMostConnections, .time_to_speak = kDeadline}) {}

  asio::awaitable<void> serve(asio::ip::tcp::socket socket,
                              std::unique_ptr<intake::Acceptor::Peer> peer) {
    http::Stream stream(std::move(socket), nullptr);
    peer->set_cut([&stream](auto) { stream.cut(); });
    http::Request request;
    const http::MessageLimits limits{.head_bytes = kMostHeaderBytes};
    const auto read = co_await stream.read(request, limits);
    peer->speak();
    if (read != http::Reading::Whole || acceptor.is_stopping()) co_return;
    request.keeps_alive = false;
    const auto answer = answer_to(request);
    stream.end_after(kDeadline);
    const bool is_sent = co_await stream.write(request, answer);
    if (is_sent) stream.shut_down();
  }

  http::Answer answer_to(const http::Request& request) const {
    http::Answer answer{.fields = {{"Content-Type", "text/plain; charset=utf-8"},
                                   {"Cache-Control", "no-store"},
                                   {"X-Content-Type-Options", "nosniff"}}};
    const auto path = request.path();
    if (request.method != "GET") {
      answer.status = 405;
      answer.fields.emplace_back("Allow", "GET");
      answer.body = "Only GET.\n";
    } else if (path == "/healthz") {
      say(answer, answers.ill());
    } else if (path == "/readyz") {
      say(answer, answers.not_ready());
    } else if (path == "/metrics") {
      answer.fields.front().second = kExpositionType;
      answer.body = answers.metrics();
    } else {
      answer.status = 404;
      answer.body = "There are /healthz, /readyz and /metrics.\n";
    }
    return answer;
  }

  static void say(http::Answer& answer, const std::string& trouble) {
    if (!trouble.empty()) answer.status = 503;
    answer.body = (trouble.empty() ? "ok" : trouble) + "\n";
  }
};

Result<std::unique_ptr<FiguresServer>> FiguresServer::listen(asio::io_context& context,
                                                             const std::string& address,
                                                             std::uint16_t port,
                                                             FiguresAnswers answers) {
  const auto core = std::make_shared<Core>(context, std::move(answers));
  if (const auto opened = core->acceptor.open(address, port, "--metrics"); !opened)
    return opened.error();
  core->acceptor.start(
      [core](auto socket, auto peer) { return core->serve(std::move(socket), std::move(peer)); });
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
