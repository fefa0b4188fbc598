#pragma once

// One connection as the replicator knows it. Only the replicator's own sources include this.

#include "server/session/replication/replicator.h"

namespace trocar::replication {

struct Replicator::Client {
  net::ConnectionId id = 0;
  access::Applicant applicant;                           // as the gate knows it
  std::optional<participants::Participant> participant;  // set by Hello
  bool is_welcome = false;
  bool has_old_surface = false;  // so that no delta helps
  step::SharedFrame baseline;    // the last frame this client was given
  bool wants_keyframe = false;
  bool wants_ghost = false;
  std::uint64_t last_requested_keyframe_ns = 0;
  std::array<std::optional<std::uint32_t>, kToolsPerHand> last_sequence;
  std::uint64_t rate_window_begin_ns = 0;
  std::uint32_t messages_in_window = 0;
};

}  // namespace trocar::replication
