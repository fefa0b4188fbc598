#include "server/hall/sessions/figures_probe.h"

#include <chrono>
#include <utility>

#include "server/session/monitoring/http_ask.h"

namespace trocar::hall {
namespace {

constexpr std::chrono::seconds kProbeDeadline{2};
constexpr unsigned kOk = 200;

}  // namespace

asio::awaitable<std::optional<std::string>> get_page(std::uint16_t port, std::string path) {
  auto answer = co_await monitoring::ask({.host = "127.0.0.1",
                                          .port = port,
                                          .method = "GET",
                                          .path = std::move(path),
                                          .deadline = kProbeDeadline});
  if (!answer || answer->status != kOk) co_return std::nullopt;
  co_return std::move(answer->body);
}

}  // namespace trocar::hall
