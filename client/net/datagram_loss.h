#pragma once

// Counts what was lost of the datagrams that a peer has sent, by the numbers of their DTLS records:
// 13 bytes of header, of which 3 and 4 are the epoch and 5 to 10 a number that grows by one (RFC
// 6347 section 4.1). Only records that were opened count, so nobody else can change the figures.
//
// Thread: one at a time.

#include <algorithm>
#include <cstdint>

#include "common/base/bytes.h"

namespace trocar::net {

class DatagramLoss {
 public:
  // Takes a datagram that one record was opened from.
  void note(BytesView datagram) {
    if (datagram.size() < 13) return;
    std::uint64_t number = 0;
    for (std::size_t i = 3; i < 11; ++i) number = number << 8 | datagram[i];
    first_ = received_ == 0 ? number : std::min(first_, number);
    last_ = received_ == 0 ? number : std::max(last_, number);
    ++received_;
  }
  // Another connection numbers anew.
  void restart() {
    lost_before_ = lost();
    received_before_ += received_;
    received_ = 0;
  }
  std::uint64_t received() const { return received_before_ + received_; }
  std::uint64_t lost() const {
    const std::uint64_t sent = received_ == 0 ? 0 : last_ - first_ + 1;
    return lost_before_ + (sent > received_ ? sent - received_ : 0);  // a datagram may hold two
  }

 private:
  std::uint64_t received_ = 0, first_ = 0, last_ = 0, lost_before_ = 0, received_before_ = 0;
};

}  // namespace trocar::net
