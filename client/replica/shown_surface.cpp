#include "client/replica/shown_surface.h"

#include <utility>

#include "common/wire/surface_messages.h"
#include "proto/wire.pb.h"

namespace trocar::replica {
namespace {

std::array<std::uint32_t, 3> indices_of(const wire::Corners& corners) {
  return {corners[0].value, corners[1].value, corners[2].value};
}

}  // namespace

void ShownSurface::begin(wire::SurfaceLayout layout, std::string organ_name) {
  layout_ = std::move(layout);
  organ_name_ = std::move(organ_name);
  is_new_ = true;
  waiting_.clear();
}

Status ShownSurface::apply(const proto::SurfaceChange& message) {
  auto change = wire::read(message, layout_);
  if (!change) return change.error();
  if (auto applied = wire::apply(*change, layout_); !applied) return applied;
  newest_change_us_ = message.server_time_us();
  if (!is_new_) waiting_.push_back(std::move(*change));
  return {};
}

void ShownSurface::show() {
  if (is_new_)
    show_layout();
  else if (!waiting_.empty())
    show_changes();
}

void ShownSurface::show_layout() {
  topology_.epoch = layout_.epoch;
  topology_.organ_name = organ_name_;
  topology_.rest_positions.clear();
  for (const auto& rest : layout_.rest_quanta)
    topology_.rest_positions.push_back(wire::to_metres(rest));
  topology_.triangles.clear();
  for (std::size_t i = 0; i < layout_.triangles.size(); ++i)
    topology_.triangles.push_back(layout_.has_triangle(TriangleIndex(i))
                                      ? indices_of(layout_.triangles[i])
                                      : std::array<std::uint32_t, 3>{});
  topology_.is_wound = layout_.is_wound;
  topology_.fixed_vertices.clear();
  for (const VertexIndex v : layout_.fixed_vertices) topology_.fixed_vertices.push_back(v.value);
  ++version_;
  is_new_ = false;
}

void ShownSurface::show_changes() {
  for (const wire::SurfaceChange& change : waiting_) {
    for (const wire::NewVertex& vertex : change.new_vertices) {
      if (vertex.is_fixed)
        topology_.fixed_vertices.push_back(
            static_cast<std::uint32_t>(topology_.rest_positions.size()));
      topology_.rest_positions.push_back(wire::to_metres(vertex.rest_quanta));
    }
    for (const TriangleIndex number : change.removed) {
      topology_.triangles[number.value] = {};
      topology_.is_wound[number.value] = 0;
    }
    for (const wire::NewTriangle& triangle : change.added) {
      topology_.triangles.push_back(triangle.is_gap() ? decltype(indices_of(triangle.corners)){}
                                                      : indices_of(triangle.corners));
      topology_.is_wound.push_back(triangle.is_wound);
    }
    topology_.epoch = change.epoch;
  }
  shown_change_us_ = newest_change_us_;
  ++version_;
  waiting_.clear();
}

}  // namespace trocar::replica
