#pragma once

// Those who are connected by OpenIGTLink: what they say comes out whole and by its size checked,
// and what is published goes to all of them.
//
//   publish(key, message) --> board: the newest message of each key
//                                |  each peer has a list of keys that it has not been sent yet
//                                v
//                             one write at a time, of what the board has then
//
// So a slow peer is given the newest alone, and costs a list of keys. A peer is cut that takes
// nothing for kStall, does not end a message within that time, or says kMostFaults things that are
// damaged or no message at all. Of bodies beyond kLargeBytes one is received at a time.
// Thread: the one that runs the I/O context.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "client/slicer/incoming.h"
#include "client/slicer/outgoing.h"

namespace trocar::slicer {

inline constexpr int kMostPeers = 8, kMostFaults = 20;
inline constexpr std::size_t kLargeBytes = std::size_t{1} << 20;
inline constexpr std::chrono::seconds kStall{60};

using PeerId = std::uint64_t;

struct PeerMessage {
  PeerId peer = 0;
  Header header;
  Bytes body;
};

struct PeerEvents {
  std::function<void(PeerMessage)> heard;  // of the known kinds alone
  std::function<void(PeerId)> gone;
};

class Peers {
 public:
  // `context` outlives this.
  Peers(asio::io_context& context, PeerEvents events);
  ~Peers();

  // ErrorCode::ResourceMissing when the address cannot be had. Port 0: any free one.
  Status open(const std::string& address, std::uint16_t port);
  std::uint16_t port() const;
  int count() const;

  // Who comes later is sent it, too.
  void publish(const std::string& key, SharedBytes message);
  void retract(const std::string& key);
  // Tells a peer, and the log, that what it has said is wrong; the same again once a second. Only
  // BadMessage counts as a fault.
  void blame(PeerId peer, const Error& error);
  // Waits for what is on its way, but not long, and lets all go.
  void close();

 private:
  struct State;
  struct Link;
  std::shared_ptr<State> state_;
};

}  // namespace trocar::slicer
