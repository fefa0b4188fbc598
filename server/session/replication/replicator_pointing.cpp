// The replicator's part about who shows something: a place, a line on the surface, a view.

#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/replication/lesson_messages.h"
#include "server/session/replication/messages.h"
#include "server/session/replication/replicator_client.h"
#include "server/session/replication/validation.h"

namespace trocar::replication {
namespace {

constexpr std::uint64_t kLeastGapNs = 40'000'000;
constexpr std::uint64_t kLeastViewGapNs = 90'000'000;  // a little less than a tenth of a second

void write(const Stroke& stroke, proto::Stroke& message) {
  message.set_participant(stroke.participant.value);
  wire::QuantisedVertex before{};
  for (const auto& place : stroke.rest_quanta) {
    message.add_rest_quanta(place.x - before.x);
    message.add_rest_quanta(place.y - before.y);
    message.add_rest_quanta(place.z - before.z);
    before = place;
  }
}

}  // namespace

std::optional<Replicator::Ending> Replicator::handle_point(Client& client,
                                                           const proto::PointRequest& request) {
  const auto role = client.participant->role;
  if (!wire::rights_of(role).may_point)
    return Ending{EndReason::Role,
                  "PointRequest: pointing is the instructor's, not of " + wire::one_of(role)};
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
  proto::LessonRecord record;
  auto& point = *record.mutable_point();
  point.set_participant(client.participant->slot.value);
  if (points) *point.mutable_position_m() = request.position_m();
  proto::Envelope event;
  *event.mutable_point_event() = point;
  record_lesson(record);
  const auto bytes = wire::encode_envelope(event);
  for (const auto& [id, other] : clients_)
    if (other->listens()) send(*other, bytes);
  return std::nullopt;
}

std::optional<Replicator::Ending> Replicator::handle_stroke(Client& client,
                                                            const proto::StrokeRequest& request) {
  const auto role = client.participant->role;
  if (!wire::rights_of(role).may_point)
    return Ending{EndReason::Role,
                  "StrokeRequest: drawing is the instructor's, not of " + wire::one_of(role)};
  const auto points = check_stroke(request);
  if (!points) return Ending{EndReason::ProtocolError, points.error().message};
  const auto slot = client.participant->slot;
  const bool is_early = !client.strokes.take(1, options_.clock_ns());
  if (is_early || board_.is_full_for(points->size())) {
    proto::Envelope answer;
    describe_teaching({}, slot, false,
                      is_early ? "not drawn: at most ten strokes a second"
                               : "not drawn: the drawing is full, wipe it first",
                      *answer.mutable_teach_event());
    send(client, wire::encode_envelope(answer));
    return std::nullopt;
  }
  const auto* stroke = board_.add(slot, *points, layout_);
  if (stroke == nullptr) return std::nullopt;
  proto::Envelope event;
  event.mutable_drawing()->set_is_addition(true);
  write(*stroke, *event.mutable_drawing()->add_stroke());
  broadcast(wire::encode_envelope(event));
  record_drawing();
  return std::nullopt;
}

void Replicator::describe_drawing(proto::Drawing& message) const {
  for (const auto& stroke : board_.strokes()) write(stroke, *message.add_stroke());
}

void Replicator::wipe_drawing() {
  board_.wipe();
  proto::Envelope event;
  describe_drawing(*event.mutable_drawing());
  broadcast(wire::encode_envelope(event));
  record_drawing();
}

// All of it each time, so that whoever seeks in the recording needs the last one alone.
void Replicator::record_drawing() {
  if (!options_.on_lesson) return;
  proto::Drawing drawing;
  describe_drawing(drawing);
  wire::LessonEntry entry{wire::LessonKind::Drawing, Bytes(drawing.ByteSizeLong())};
  drawing.SerializeToArray(entry.message.data(), static_cast<int>(entry.message.size()));
  options_.on_lesson(std::move(entry));
}

std::optional<Replicator::Ending> Replicator::handle_view(Client& client,
                                                          const proto::ViewRequest& request) {
  if (const auto valid = check_view(request); !valid)
    return Ending{EndReason::ProtocolError, valid.error().message};
  const auto slot = client.participant->slot;
  // Whoever has just lost the view does not know it yet.
  const auto now = options_.clock_ns();
  if (!roster_.find(slot)->leads_view || now - client.viewed_ns < kLeastViewGapNs)
    return std::nullopt;
  client.viewed_ns = now;
  proto::LessonRecord record;
  auto& view = *record.mutable_view();
  view.set_participant(slot.value);
  *view.mutable_eye_m() = request.eye_m();
  *view.mutable_target_m() = request.target_m();
  view.set_server_time_us(now / 1000);
  proto::Envelope event;
  *event.mutable_view_event() = view;
  record_lesson(record);
  last_view_ = wire::encode_envelope(event);
  for (const auto& [id, other] : clients_)
    if (other->listens() && other.get() != &client) send(*other, last_view_);
  return std::nullopt;
}

bool Replicator::show_lesson(Client& client) {
  const bool is_as_usual = !is_paused_ && rate_ == 1 && paced_by_.empty();
  if (!is_as_usual && !send(client, pace_message())) return false;
  if (std::ranges::count(is_marked_, true) > 0 && !send(client, mark_list())) return false;
  if (!board_.strokes().empty()) {
    proto::Envelope event;
    describe_drawing(*event.mutable_drawing());
    if (!send(client, wire::encode_envelope(event))) return false;
  }
  if (course_) {
    proto::Envelope event;
    describe(*course_, *event.mutable_lesson_stage());
    if (!send(client, wire::encode_envelope(event))) return false;
  }
  return !last_view_ || send(client, last_view_);
}

}  // namespace trocar::replication
