#pragma once

// Asks a server of this machine for one page over HTTP: its health or its figures.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <optional>
#include <string>

namespace trocar::hall {

// Returns the body of an answer with status 200 from 127.0.0.1, within 2 s; nothing
// if there is none.
asio::awaitable<std::optional<std::string>> get_page(std::uint16_t port, std::string path);

}  // namespace trocar::hall
