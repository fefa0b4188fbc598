// The organ's fine surface, for who has joined: a part at a time, each after a frame newer than the
// one before has been acknowledged. Where frames come on the same stream, the part has arrived by
// then, and no frame waits behind more than one part. Where they come as datagrams, which overtake
// it, only the bytes that are still to be acknowledged tell: no part is added to a queue of them.

#include <algorithm>

#include "server/session/replication/replicator_client.h"

namespace trocar::replication {

void Replicator::give_fine_surface(Client& client) {
  if (client.fine_parts >= options_.fine_surface.size() || !client.participant) return;
  const Frame newest = encoder_.current()->frame;
  const bool has_arrived = client.fine_parts == 0 || client.acknowledged > client.fine_frame;
  const bool is_paused = newest == client.fine_frame;
  if (!has_arrived && !is_paused) return;
  // The newest frame may still be there, but no queue.
  const auto limit = std::max(options_.skip_above_bytes / 4, 2 * encoder_.typical_frame_bytes());
  if (connections_.outstanding_bytes(client.id) > limit) return;
  if (!send(client, options_.fine_surface[client.fine_parts])) return;  // the next time
  ++client.fine_parts;
  client.fine_frame = newest;
}

}  // namespace trocar::replication
