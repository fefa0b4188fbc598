#include "server/session/replication/drawing_board.h"

#include <cmath>

#include "common/wire/lesson.h"

namespace trocar::replication {
namespace {

std::optional<wire::QuantisedVertex> rest_place(const SurfacePoint& point,
                                                const wire::SurfaceLayout& layout) {
  if (point.triangle >= layout.triangles.size()) return std::nullopt;
  const TriangleIndex number(point.triangle);
  if (!layout.has_triangle(number)) return std::nullopt;
  const auto& corners = layout.triangles[number.value];
  const std::array<float, 3> weights{1 - point.weight[0] - point.weight[1], point.weight[0],
                                     point.weight[1]};
  Vec3f place;
  for (std::size_t i = 0; i < weights.size(); ++i)
    place += wire::to_metres(layout.rest_quanta[corners[i].value]) * weights[i];
  const auto quanta = [](float metres) {
    return static_cast<std::int32_t>(std::lround(metres / wire::kQuantumMetres));
  };
  return wire::QuantisedVertex{quanta(place.x), quanta(place.y), quanta(place.z)};
}

}  // namespace

bool DrawingBoard::is_full_for(std::size_t points) const {
  return points_ + points > wire::kMostDrawingPoints;
}

const Stroke* DrawingBoard::add(ParticipantSlot who, std::span<const SurfacePoint> points,
                                const wire::SurfaceLayout& layout) {
  Stroke stroke{who, {}};
  for (const auto& point : points)
    if (const auto place = rest_place(point, layout)) stroke.rest_quanta.push_back(*place);
  if (stroke.rest_quanta.empty()) return nullptr;
  points_ += stroke.rest_quanta.size();
  return &strokes_.emplace_back(std::move(stroke));
}

void DrawingBoard::wipe() {
  strokes_.clear();
  points_ = 0;
}

}  // namespace trocar::replication
