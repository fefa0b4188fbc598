// The organ's fine surface, for who has joined: a part at a time, each after the one before has
// arrived, so that no frame waits behind more than one part.

#include "server/session/replication/replicator_client.h"

namespace trocar::replication {

void Replicator::give_fine_surface(Client& client) {
  if (client.fine_parts >= options_.fine_surface.size() || !client.participant) return;
  const Frame newest = encoder_.current()->frame;
  const bool has_arrived = client.fine_parts == 0 || client.acknowledged > client.fine_frame;
  const bool is_paused = newest == client.fine_frame;
  if (!has_arrived && !is_paused) return;
  // The newest frame may still be there, but no queue.
  if (connections_.outstanding_bytes(client.id) > options_.skip_above_bytes / 4) return;
  if (!send(client, options_.fine_surface[client.fine_parts])) return;  // the next time
  ++client.fine_parts;
  client.fine_frame = newest;
}

}  // namespace trocar::replication
