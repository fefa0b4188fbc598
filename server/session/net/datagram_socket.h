#pragma once

// A UDP socket that knows to which address of this machine a datagram came, and answers from it.
// One that is bound to any address would answer from whichever the route has, and the peer's
// socket, or a firewall on the way, would not take that for an answer.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/ip/udp.hpp>
#include <optional>
#include <span>

#include "common/base/bytes.h"

namespace trocar::net {

struct Arrival {
  asio::ip::udp::endpoint peer;
  asio::ip::address local;  // unspecified: not known
  std::size_t bytes = 0;
};

// Asks it of a socket that is open, before it is bound. False: the system does not tell addresses.
bool ask_for_local_addresses(asio::ip::udp::socket& socket);
// None: nothing more is there. Does not block.
std::optional<Arrival> receive_datagram(asio::ip::udp::socket& socket,
                                        std::span<std::uint8_t> room);
// False: the socket did not take it.
bool send_datagram(asio::ip::udp::socket& socket, BytesView datagram,
                   const asio::ip::udp::endpoint& peer, const asio::ip::address& local);

}  // namespace trocar::net
