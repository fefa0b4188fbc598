// The replica's part about the lesson: what instructors do, what people say, point at and draw.

#include <algorithm>
#include <array>

#include "client/replica/replica.h"
#include "common/wire/lesson.h"
#include "proto/wire.pb.h"

namespace trocar::replica {
namespace {

// Two of a server's: it takes no more.
constexpr std::size_t kMostPoints = 2 * wire::kMostDrawingPoints;

Vec3f place_of(const proto::Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

}  // namespace

void Replica::apply_mark(const proto::MarkEvent& message, std::uint64_t arrival_ns) {
  counters_.marks += message.is_done() ? 1 : 0;
  tell_all(message.tick(), message.text(), arrival_ns);
}

void Replica::apply_teach(const proto::TeachEvent& message, std::uint64_t arrival_ns) {
  tell_all(message.tick(), message.text(), arrival_ns);
}

void Replica::tell_all(Tick tick, const std::string& text, std::uint64_t arrival_ns) {
  Notice notice;
  notice.tick = tick;
  notice.text = text;
  notice.arrival_ns = arrival_ns;
  notice.is_for_all = true;
  add_notice(std::move(notice));
}

void Replica::apply_point(const proto::PointEvent& message, std::uint64_t arrival_ns) {
  if (message.participant() >= kMaxParticipants) return fail("PointEvent: slot out of range");
  const ParticipantSlot who{static_cast<std::uint8_t>(message.participant())};
  std::erase_if(pointers_, [who](const Pointer& known) { return known.participant == who; });
  if (!message.has_position_m()) return;
  const Vec3f place = place_of(message.position_m());
  if (!is_finite(place)) return fail("PointEvent.position_m: not finite");
  pointers_.push_back({who, place, arrival_ns});
}

std::vector<Pointer> Replica::pointers(std::uint64_t now_ns) const {
  std::vector<Pointer> shown;
  for (const auto& pointer : pointers_)
    if (now_ns < pointer.arrival_ns + kPointerNs) shown.push_back(pointer);
  return shown;
}

void Replica::apply_drawing(const proto::Drawing& message) {
  auto strokes = message.is_addition() ? strokes_ : std::vector<Stroke>{};
  std::size_t points = 0;
  for (const auto& stroke : strokes) points += stroke.rest_m.size();
  for (const auto& entry : message.stroke()) {
    if (entry.participant() >= kMaxParticipants) return fail("Drawing: slot out of range");
    if (entry.rest_quanta_size() % 3 != 0) return fail("Drawing: a point has three numbers");
    points += static_cast<std::size_t>(entry.rest_quanta_size()) / 3;
    if (points > kMostPoints) return fail("Drawing: it has too many points");
    auto& stroke = strokes.emplace_back();
    stroke.participant = {static_cast<std::uint8_t>(entry.participant())};
    wire::QuantisedVertex at{};
    for (int i = 0; i < entry.rest_quanta_size(); i += 3) {
      const std::array<std::int64_t, 3> next{std::int64_t{at.x} + entry.rest_quanta(i),
                                             std::int64_t{at.y} + entry.rest_quanta(i + 1),
                                             std::int64_t{at.z} + entry.rest_quanta(i + 2)};
      for (const auto value : next)
        if (value < -2 * wire::kMaxQuanta || value > 2 * wire::kMaxQuanta)
          return fail("Drawing: a point is farther than 2 m from the origin");
      at = {static_cast<std::int32_t>(next[0]), static_cast<std::int32_t>(next[1]),
            static_cast<std::int32_t>(next[2])};
      stroke.rest_m.push_back(wire::to_metres(at));
    }
  }
  strokes_ = std::move(strokes);
  if (!message.is_addition()) ++drawing_version_;
}

void Replica::apply_view(const proto::ViewEvent& message, std::uint64_t arrival_ns) {
  if (message.participant() >= kMaxParticipants) return fail("ViewEvent: slot out of range");
  const LedView view{{static_cast<std::uint8_t>(message.participant())},
                     place_of(message.eye_m()),
                     place_of(message.target_m()),
                     arrival_ns};
  if (!is_finite(view.eye_m) || !is_finite(view.target_m))
    return fail("ViewEvent: eye_m or target_m is not finite");
  if (length(view.eye_m - view.target_m) < wire::kLeastViewM) return;
  led_view_ = view;
}

}  // namespace trocar::replica
