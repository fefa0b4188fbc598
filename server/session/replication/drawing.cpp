#include "server/session/replication/drawing.h"

#include "proto/journal.pb.h"
#include "proto/wire.pb.h"

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

std::optional<Ending> Drawing::point(Speaker& who, const proto::PointRequest& request) {
  const auto role = who.participant->role;
  if (!wire::rights_of(role).may_point)
    return Ending{EndReason::Role,
                  "PointRequest: pointing is the instructor's, not of " + wire::one_of(role)};
  const bool points = request.has_position_m();
  if (points)
    if (const auto valid = check_place(request.position_m()); !valid)
      return Ending{EndReason::ProtocolError, "PointRequest.position_m: " + valid.error().message};
  // Each goes to everybody, so that what comes too often is left out; an end is always told.
  const auto now = session_.now_ns();
  if (points && who.pointed_ns != 0 && now - who.pointed_ns < kLeastGapNs) return std::nullopt;
  if (!points && who.pointed_ns == 0) return std::nullopt;
  who.pointed_ns = points ? now : 0;
  proto::LessonRecord record;
  auto& point = *record.mutable_point();
  point.set_participant(who.participant->slot.value);
  if (points) *point.mutable_position_m() = request.position_m();
  proto::Envelope event;
  *event.mutable_point_event() = point;
  session_.record(wire::LessonKind::Said, record);
  session_.audience.offer(wire::encode_envelope(event));
  return std::nullopt;
}

std::optional<Ending> Drawing::stroke(Speaker& who, const proto::StrokeRequest& request,
                                      const wire::SurfaceLayout& layout) {
  const auto role = who.participant->role;
  if (!wire::rights_of(role).may_point)
    return Ending{EndReason::Role,
                  "StrokeRequest: drawing is the instructor's, not of " + wire::one_of(role)};
  const auto points = check_stroke(request);
  if (!points) return Ending{EndReason::ProtocolError, points.error().message};
  const bool is_early = !who.strokes.take(1, session_.now_ns());
  if (is_early || board_.is_full_for(points->size())) {
    session_.refuse(who, is_early ? "not drawn: at most ten strokes a second"
                                  : "not drawn: the drawing is full, wipe it first");
    return std::nullopt;
  }
  const auto* stroke = board_.add(who.participant->slot, *points, layout);
  if (stroke == nullptr) return std::nullopt;
  proto::Envelope event;
  event.mutable_drawing()->set_is_addition(true);
  write(*stroke, *event.mutable_drawing()->add_stroke());
  session_.audience.broadcast(wire::encode_envelope(event));
  record();
  return std::nullopt;
}

void Drawing::describe(proto::Drawing& message) const {
  for (const auto& stroke : board_.strokes()) write(stroke, *message.add_stroke());
}

void Drawing::wipe() {
  board_.wipe();
  proto::Envelope event;
  describe(*event.mutable_drawing());
  session_.audience.broadcast(wire::encode_envelope(event));
  record();
}

// All of it each time, so that whoever seeks in the recording needs the last one alone.
void Drawing::record() const {
  proto::Drawing drawing;
  describe(drawing);
  session_.record(wire::LessonKind::Drawing, drawing);
}

std::optional<Ending> Drawing::view(Speaker& who, const proto::ViewRequest& request) {
  if (const auto valid = check_view(request); !valid)
    return Ending{EndReason::ProtocolError, valid.error().message};
  const auto slot = who.participant->slot;
  // Whoever has just lost the view does not know it yet.
  const auto now = session_.now_ns();
  if (!session_.roster.find(slot)->leads_view || now - who.viewed_ns < kLeastViewGapNs)
    return std::nullopt;
  who.viewed_ns = now;
  proto::LessonRecord record;
  auto& view = *record.mutable_view();
  view.set_participant(slot.value);
  *view.mutable_eye_m() = request.eye_m();
  *view.mutable_target_m() = request.target_m();
  view.set_server_time_us(now / 1000);
  proto::Envelope event;
  *event.mutable_view_event() = view;
  session_.record(wire::LessonKind::Said, record);
  last_view_ = wire::encode_envelope(event);
  session_.audience.offer(last_view_, &who);
  return std::nullopt;
}

bool Drawing::show_lines(const Speaker& newcomer) const {
  if (board_.strokes().empty()) return true;
  proto::Envelope event;
  describe(*event.mutable_drawing());
  return session_.audience.send(newcomer, wire::encode_envelope(event));
}

bool Drawing::show_view(const Speaker& newcomer) const {
  return !last_view_ || session_.audience.send(newcomer, last_view_);
}

}  // namespace trocar::replication
