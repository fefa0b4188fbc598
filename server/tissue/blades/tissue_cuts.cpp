#include "server/tissue/blades/tissue_cuts.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "common/base/checksum.h"
#include "server/tissue/cutting/event_codec.h"
#include "server/tissue/world/surface_layout.h"

namespace trocar::blades {
namespace {

// Numbers of triangles are used once. What is left is for the ticks up to the next frame.
constexpr std::size_t kMostTriangles = wire::kMaxSurfaceTriangles - 500'000;

// No blade of a session moves nodes: clients hold rest positions to be constant.
bool moves_nodes(const cutting::CutEvents& events) {
  return std::ranges::any_of(events.events, [](const cutting::CutEvent& event) {
    return std::holds_alternative<cutting::Move>(event);
  });
}

}  // namespace

TissueCuts::TissueCuts(const organ::Organ& organ, const cutting::Settings& settings)
    : settings_(settings),
      topology_(organ),
      tearing_(organ),
      surface_(organ),
      layout_(world::make_surface_layout(organ)) {
  if (!organ.mesh.tets.empty() && !topology_.has_links())
    cutter_ = std::make_unique<cutting::Cutter>(topology_, settings_);
  first_pending_ = static_cast<std::uint32_t>(layout_.triangles.size());
}

bool TissueCuts::is_full() const {
  return layout_.triangles.size() >= kMostTriangles;
}

void TissueCuts::tear(const world::World& world, std::span<const NodeIndex> nodes) {
  if (can_tear() && !is_full()) cutter_->tear(tearing_.find(topology_, world.displacements, nodes));
}

std::optional<topology::Edit> TissueCuts::cut(const BladeTable::Hands& hands,
                                              const world::World& world, double travel_m,
                                              CutReport& report) {
  const auto& tools = hands.tools;
  report = {};
  if (!can_cut()) return std::nullopt;
  report.is_full = is_full();
  const auto lifted = blades_.begin_tick(hands, !report.is_full);
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    if ((lifted >> i & 1) != 0) cutter_->lift(i);
    if (!blades_[ToolSlot{i}].is_cutting) continue;
    const auto& moved = blades_[ToolSlot{i}].edge.tissue_m();
    cutter_->carry(i, {to_double(moved[0]), to_double(moved[1])});
    const auto edge = hands::edge_of(tools[ToolSlot{i}]);
    cutter_->move(i, std::array{to_double(edge[0]), to_double(edge[1])});
  }
  look_at_edges(tools, world, travel_m);
  cutter_->cut(world.displacements, output_, travel_m);
  report.crossed_tets = output_.crossed_tets;
  report.splits = output_.splits;
  report.opened_area_m2 = output_.opened_area_m2;
  report.torn_area_m2 = output_.torn_area_m2;
  report.is_behind = output_.is_behind;
  std::array<BladeWound, kMaxTools> wounds;
  for (std::uint8_t i = 0; i < kMaxTools; ++i)
    wounds[i] = {static_cast<float>(output_.blade_work_j[i]), static_cast<float>(cutter_->h_at(i))};
  blades_.end_tick(tools, wounds);
  for (std::uint8_t i = 0; i < kMaxTools; ++i)
    if (blades_[ToolSlot{i}].is_in_tissue()) last_work_ = world.tick;
  if (output_.events.events.empty()) return std::nullopt;
  new_nodes_.assign(output_.new_nodes.begin(), output_.new_nodes.end());
  record(output_.events);
  last_work_ = world.tick;
  return edit();
}

std::optional<std::array<EdgeEnds, 2>> TissueCuts::sweep_of(ToolSlot tool,
                                                            const hands::ToolTable& tools) const {
  const Blade& blade = blades_[tool];
  if (!blade.is_at_work || !blade.is_cutting || tools[tool].verb != tool::Verb::Cut)
    return std::nullopt;
  const auto now = hands::edge_of(tools[tool]);
  if (BladeTable::has_jumped(blade, now)) return std::nullopt;
  return std::array{blade.edge.ends(), now};
}

void TissueCuts::break_tie(std::size_t tie) {
  topology_.ties().set_broken(tie);
  for (const auto& end : topology_.ties()[tie].ends)
    for (const auto node : end.nodes)
      if (topology_.has_node(node)) topology_.mark(node);
}

// Blades take turns. Friction is on both sides of a blade that is as broad as the tool.
void TissueCuts::look_at_edges(const hands::ToolTable& tools, const world::World& world,
                               double travel_m) {
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const ToolSlot slot{i};
    if (!blades_[slot].is_cutting || (world.tick + i) % EdgeForce::kLookEvery != 0) continue;
    const auto& shape = tools[slot].shape;
    const auto breadth = 2 * static_cast<double>(shape.radius_m + shape.half_width_m);
    const auto edge = hands::edge_of(tools[slot]);
    auto resistance = cutter_->resistance_of(world.displacements, world.velocities, travel_m,
                                             to_double(edge[0]), to_double(edge[1]));
    for (auto& cut_n : resistance.cut_n) cut_n *= static_cast<double>(hands_share(shape.form));
    resistance.whole_cut_n *= static_cast<double>(hands_share(shape.form));
    blades_.look(slot, resistance, 2 * breadth);
  }
}

void TissueCuts::record(cutting::CutEvents events) {
  Bytes bytes(sizeof history_hash_);
  std::memcpy(bytes.data(), &history_hash_, sizeof history_hash_);
  cutting::encode(events, bytes);
  history_hash_ = xxh3_64(bytes);
  history_.push_back(std::move(events));
}

// Brings the surface up to date with the topology and returns what has changed.
topology::Edit TissueCuts::edit() {
  const auto& surface = surface_.update(topology_);
  topology::follow_ties(surface, topology_);
  return {topology_, new_nodes_, surface};
}

void TissueCuts::extend_layout(const topology::Edit& edit, const world::World& world) {
  const std::size_t first_new = layout_.vertex_of_node.size();
  const std::size_t first_made = world.node_count() - world.origins.size();
  layout_.vertex_of_node.resize(topology_.node_count());
  for (const auto node : edit.surface.surfaced) {
    const VertexIndex slot(layout_.vertex_count());
    wire::NewVertex vertex{.node = node};
    vertex.rest_quanta = wire::quantise_rest(topology_.rest().subspan(node.value, 1)).front();
    vertex.is_fixed = world.node_classes[node.value] == world::NodeClass::Fixed;
    if (node.value >= first_new) {
      const auto& origin = world.origins[node.value - first_made];
      const auto a = layout_.vertex_of_node[origin.a.value],
                 b = layout_.vertex_of_node[origin.b.value];
      if (a.is_valid() && b.is_valid()) vertex.a = a, vertex.b = b, vertex.t = origin.t;
    }
    layout_.node_of_vertex.push_back(node);
    layout_.vertex_of_node[node.value] = slot;
    layout_.rest_quanta.push_back(vertex.rest_quanta);
    if (vertex.is_fixed) layout_.fixed_vertices.push_back(slot);
    pending_.new_vertices.push_back(vertex);
  }
  for (const auto triangle : edit.surface.removed) {
    auto& corners = layout_.triangles[triangle.value];
    auto& is_wound = layout_.is_wound[triangle.value];
    layout_.triangle_sum -= wire::triangle_hash(triangle, corners, is_wound != 0);
    corners = {};
    is_wound = 0;
    if (triangle.value < first_pending_)
      pending_.removed.push_back(triangle);
    else
      pending_.added[triangle.value - first_pending_] = {};
  }
  for (const auto& added : edit.surface.added) {
    const TriangleIndex number(layout_.triangles.size());
    wire::NewTriangle triangle{.is_wound = added.is_wound};
    for (std::size_t k = 0; k < 3; ++k)
      triangle.corners[k] = layout_.vertex_of_node[added.nodes[k].value];
    layout_.triangles.push_back(triangle.corners);
    layout_.is_wound.push_back(triangle.is_wound);
    layout_.triangle_sum += wire::triangle_hash(number, triangle.corners, triangle.is_wound);
    pending_.added.push_back(triangle);
    if (added.is_wound && added.material > 0) name_region(added.material);
  }
}

void TissueCuts::name_region(std::uint16_t material) {
  const auto& name = topology_.organ().regions[material - 1u].name;
  const auto at = std::ranges::lower_bound(pending_.regions, name);
  if (pending_.regions.size() < wire::kMaxChangeRegions &&
      (at == pending_.regions.end() || *at != name))
    pending_.regions.insert(at, name);
}

std::shared_ptr<const wire::SurfaceChange> TissueCuts::pop_change() {
  published_ = static_cast<std::uint32_t>(history_.size());
  if (pending_.new_vertices.empty() && pending_.removed.empty() && pending_.added.empty())
    return nullptr;
  std::ranges::sort(pending_.removed);
  pending_.from_epoch = layout_.epoch;
  pending_.epoch = ++layout_.epoch;
  pending_.sum = layout_.triangle_sum;
  auto change = std::make_shared<const wire::SurfaceChange>(std::move(pending_));
  forget_pending();
  return change;
}

void TissueCuts::replace(const TissueCuts& before) {
  layout_.epoch = before.layout_.epoch;
  is_new_to_clients_ = true;
  for (std::uint8_t i = 0; i < kMaxTools; ++i)
    if (blades_[ToolSlot{i}].is_cutting) cutter_->lift(i);
  blades_.clear();
}

std::shared_ptr<const wire::SurfaceLayout> TissueCuts::pop_new_layout() {
  if (!std::exchange(is_new_to_clients_, false)) return nullptr;
  published_ = static_cast<std::uint32_t>(history_.size());
  forget_pending();
  ++layout_.epoch;
  return std::make_shared<const wire::SurfaceLayout>(layout_);
}

void TissueCuts::forget_pending() {
  pending_ = {};
  first_pending_ = static_cast<std::uint32_t>(layout_.triangles.size());
}

void TissueCuts::visit_state(world::StateArchive& archive, const HandOut& hand_out) {
  archive.value(history_hash_);
  archive.value(last_work_);
  archive.value(published_);
  archive.value(layout_.epoch);
  archive.flag(is_new_to_clients_);
  if (!archive.is_hashing()) {  // history_hash_ stands for it
    auto count = static_cast<std::uint32_t>(history_.size());
    archive.value(count);
    if (archive.is_reading())
      read_history(archive, count, hand_out);
    else
      for (auto& events : history_) cutting::visit_state(archive, events);
  }
  if (!archive.ok()) return;
  if (can_cut()) cutter_->visit_state(archive);
  blades_.visit_state(archive);
}

void TissueCuts::read_history(world::StateArchive& archive, std::uint32_t count,
                              const HandOut& hand_out) {
  const auto wanted = history_hash_;
  history_hash_ = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    cutting::CutEvents events;
    cutting::visit_state(archive, events);
    if (!archive.ok() || !can_cut() || moves_nodes(events) || !cutter_->repeat(events, new_nodes_))
      return archive.fail();
    record(std::move(events));
    hand_out(edit());
    end_edit();
    if (history_.size() == published_) forget_pending();
  }
  if (history_hash_ != wanted || published_ > history_.size()) archive.fail();
}

}  // namespace trocar::blades
