#pragma once

// Hands that feel say and hear this over one connection. A reading that the stream has not taken
// yet gives way to the next of its tool. Thread: the Asio thread.

#include <array>
#include <vector>

#include "client/net/datagram_path.h"
#include "client/net/net_figures.h"
#include "client/replica/hand_line.h"
#include "common/wire/framing.h"
#include "proto/wire.pb.h"

namespace trocar::net {

class HandMessages {
 public:
  static constexpr std::size_t kMostReports = 64;  // 4 s of two hands

  HandMessages(replica::HandLine& hands, NetFigures& figures) : hands_(hands), figures_(figures) {}

  // Forgets what another connection has not taken.
  void begin();
  void hear(const proto::Envelope& message);
  // Asks the hands. `datagrams`, which may be null, carries what it can; true: something waits for
  // the stream.
  bool ask(DatagramPath* datagrams, std::uint64_t now_ns);
  // Appends what waits for the stream.
  void move_to(std::vector<wire::SharedBytes>& frames);

 private:
  replica::HandLine& hands_;
  NetFigures& figures_;
  std::array<wire::SharedBytes, kToolsPerHand> readings_;  // by tool; null: none
  std::vector<wire::SharedBytes> reports_;                 // at most kMostReports
  std::uint32_t sequence_ = 0;                             // of readings
};

}  // namespace trocar::net
