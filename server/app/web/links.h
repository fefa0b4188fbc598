#pragma once

// The links that people open in a browser, with the codes of sessions whose link file is on this
// machine.

#include <cstdint>
#include <string>
#include <vector>

#include "server/app/web/options.h"

namespace trocar::app {

struct RoleLink {
  std::string role, url;
  bool has_code = false;  // else there is a place for the code
};

// Returns one for each role of a session.
std::vector<RoleLink> links_to(const WebOptions& options, std::uint16_t port,
                               const follow::SessionAddress& session);
// All of them, a line each, and those of recordings and of practice unless their key is empty.
// Below those that lead in by themselves their QR codes, where somebody asks for them, or sits at a
// terminal and other machines reach the page.
std::string describe_links(const WebOptions& options, std::uint16_t port,
                           const std::string& recordings_key, const std::string& practice_key);
// The same for a page: [{"role", "url", "width", "modules"}], the last two of the QR code
// (site::QrCode). Only links with a code are in it.
std::string links_as_json(const std::vector<RoleLink>& links);

}  // namespace trocar::app
