// The organ's fine surface, for who has joined or carries guests: a part at a time (part_pacer.h).
// Where frames come as datagrams, which overtake the stream, only the bytes that are still to be
// acknowledged tell whether a part has arrived: none is added to a queue of them.

#include <algorithm>

#include "server/session/replication/replicator_client.h"

namespace trocar::replication {

void Replicator::give_fine_surface(Client& client) {
  auto& parts = client.fine_parts;
  const Frame newest = encoder_.current()->frame;
  if (parts.next() >= options_.fine_surface.size() || !parts.may_send(newest)) return;
  // The newest frame may still be there, but no queue.
  const auto limit = std::max(options_.skip_above_bytes / 4, 2 * encoder_.typical_frame_bytes());
  if (connections_.outstanding_bytes(client.id) > limit) return;
  if (send(client, options_.fine_surface[parts.next()])) parts.on_sent(newest);  // or the next time
}

}  // namespace trocar::replication
