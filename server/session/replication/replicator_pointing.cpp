// The replicator's part about who points: a place that is passed on to everybody, and kept nowhere.

#include "proto/wire.pb.h"
#include "server/session/replication/messages.h"
#include "server/session/replication/replicator_client.h"
#include "server/session/replication/validation.h"

namespace trocar::replication {
namespace {

constexpr std::uint64_t kLeastGapNs = 40'000'000;

}  // namespace

std::optional<Replicator::Ending> Replicator::handle_point(Client& client,
                                                           const proto::PointRequest& request) {
  const auto role = client.participant->role;
  if (!wire::rights_of(role).may_point)
    return Ending{EndReason::Role,
                  std::string("PointRequest: pointing is the instructor's, not of an ") +
                      participants::name_of(role)};
  const bool points = request.has_position_m();
  if (points)
    if (const auto valid = check_place(request.position_m()); !valid)
      return Ending{EndReason::ProtocolError, "PointRequest.position_m: " + valid.error().message};
  // Each goes to everybody, so that what comes too often is left out; an end is always told.
  const auto now = options_.clock_ns();
  if (points && client.pointed_ns != 0 && now - client.pointed_ns < kLeastGapNs)
    return std::nullopt;
  if (!points && client.pointed_ns == 0) return std::nullopt;
  client.pointed_ns = points ? now : 0;
  const auto bytes = encode_point(client.participant->slot, request);
  for (const auto& [id, other] : clients_)
    if (other->participant) send(*other, bytes);
  return std::nullopt;
}

}  // namespace trocar::replication
