#include "server/app/web/links.h"

#include <fmt/format.h>
#include <unistd.h>

#include "common/base/json.h"
#include "common/secure/link_file.h"
#include "common/secure/loopback.h"
#include "common/secure/public_host.h"
#include "server/web/site/qr_code.h"

namespace trocar::app {
namespace {

std::string link_head(const WebOptions& options, std::uint16_t port) {
  const std::string scheme = options.is_insecure ? "http://" : "https://";
  if (!options.public_name.empty()) return scheme + options.public_name + "/";
  return fmt::format("{}{}:{}/", scheme, secure::public_host(options.address), port);
}

// A phone reaches nothing that only this machine does.
bool shows_pictures(const WebOptions& options) {
  if (options.draws_codes) return true;
  const bool is_far = !options.public_name.empty() || !secure::is_loopback(options.address);
  return is_far && ::isatty(STDOUT_FILENO) == 1;
}

std::string picture_of(const std::string& role, const std::string& url) {
  const auto code = site::QrCode::of(url);
  return code ? fmt::format("\n  {}\n{}", role, code->for_terminal()) : std::string();
}

}  // namespace

std::vector<RoleLink> links_to(const WebOptions& options, std::uint16_t port,
                               const follow::SessionAddress& session) {
  const auto head = link_head(options, port);
  const bool is_first = session.name == options.sessions.front().name;
  const std::string which = is_first ? "" : "&session=" + session.name;
  const bool is_here = secure::is_loopback(session.host) || session.host == options.address;
  std::vector<RoleLink> links;
  for (const auto* role : {"surgeon", "assistant", "instructor", "observer"}) {
    RoleLink link{.role = role, .url = {}};
    std::string code = "CODE";
    if (is_here)
      if (const auto known = secure::read_link_file(session.port, role); known) {
        code = secure::to_text(*known);
        link.has_code = true;
      }
    link.url = fmt::format("{}#join={}&role={}{}", head, code, role, which);
    links.push_back(std::move(link));
  }
  return links;
}

std::string describe_links(const WebOptions& options, std::uint16_t port,
                           const std::string& recordings_key, const std::string& practice_key) {
  std::string text = "Links for a browser:\n", pictures;
  const bool has_pictures = shows_pictures(options);
  for (const auto& session : options.sessions)
    for (const auto& link : links_to(options, port, session)) {
      text += fmt::format("  {:<10}  {}\n", link.role, link.url);
      if (has_pictures && link.has_code) pictures += picture_of(link.role, link.url);
    }
  if (!recordings_key.empty())
    text += fmt::format("  {:<10}  {}#recordings={}\n", "recordings", link_head(options, port),
                        recordings_key);
  if (!practice_key.empty()) {
    const auto url = link_head(options, port) + "#practice=" + practice_key;
    text += fmt::format("  {:<10}  {}\n", "practice", url);
    if (has_pictures) pictures += picture_of("practice", url);
  }
  return text + pictures;
}

std::string links_as_json(const std::vector<RoleLink>& links) {
  Json all = Json::array();
  for (const auto& link : links) {
    const auto code = site::QrCode::of(link.url);
    if (!link.has_code || !code) continue;
    all.push_back({{"role", link.role},
                   {"url", link.url},
                   {"width", code->width()},
                   {"modules", code->digits()}});
  }
  return all.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace trocar::app
