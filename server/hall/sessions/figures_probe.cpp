#include "server/hall/sessions/figures_probe.h"

#include <chrono>
#include <utility>

#include "common/http/ask.h"

namespace trocar::hall {
namespace {

constexpr std::chrono::seconds kProbeDeadline{2};
constexpr unsigned kOk = 200;

}  // namespace

asio::awaitable<std::optional<std::string>> get_page(std::uint16_t port, std::string path) {
  // It has a name: gcc 12 destroys twice what is made in braces where a coroutine waits.
  http::Question question;
  question.host = "127.0.0.1";
  question.port = port;
  question.method = "GET";
  question.path = std::move(path);
  question.deadline = kProbeDeadline;
  auto answer = co_await http::ask(std::move(question));
  if (!answer || answer->status != kOk) co_return std::nullopt;
  co_return std::move(answer->body);
}

}  // namespace trocar::hall
