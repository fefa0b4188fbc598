#pragma once

// Decides when the next part of something large goes to a client, beside its frames: after a frame
// newer than the part before has been acknowledged. Where frames come on the same stream, that part
// has arrived by then, and no frame waits behind more than one. While no frame comes, the next part
// goes when the client is attended again.
//
// Thread: one.

#include <algorithm>
#include <cstddef>

#include "common/base/tick.h"

namespace trocar::pacing {

class PartPacer {
 public:
  std::size_t next() const { return sent_; }  // number of the part, from 0
  bool has_arrived() const { return sent_ == 0 || acknowledged_ > frame_; }
  // `newest`: the frame that was published last.
  bool may_send(Frame newest) const { return has_arrived() || newest == frame_; }
  void on_sent(Frame newest) {
    ++sent_;
    frame_ = newest;
  }
  void on_acknowledged(Frame frame) { acknowledged_ = std::max(acknowledged_, frame); }
  // The first part is the next one.
  void begin() { sent_ = 0; }

 private:
  std::size_t sent_ = 0;
  Frame frame_ = 0;         // the newest one when the last part was sent
  Frame acknowledged_ = 0;  // the newest one
};

}  // namespace trocar::pacing
