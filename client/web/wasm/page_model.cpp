#include "client/web/wasm/page_model.h"

#include <algorithm>

#include "common/wire/blood_codec.h"
#include "common/wire/framing.h"
#include "proto/wire.pb.h"

namespace trocar::wasm {
namespace {

// The native picture has the same.
constexpr float kRegionStrength = 0.50f, kFirmHoldStrength = 0.95f, kTouchStrength = 0.60f;
constexpr float kLineHalfWidth = 0.0009f;  // m
constexpr std::size_t kMostOutboxBytes = 64 * 1024;

PageTint tint_of(shape::Colour colour, float strength) {
  const auto linear = [strength](std::uint8_t value) {
    const float x = static_cast<float>(value) / 255;
    return x * x * strength;
  };
  return {linear(colour.r), linear(colour.g), linear(colour.b), strength};
}

std::uint64_t to_ns(double ms) {
  return ms > 0 && ms < 1e12 ? static_cast<std::uint64_t>(ms * 1e6) : 0;
}

float flag(bool value) {
  return value ? 1.0f : 0.0f;
}

}  // namespace

PageModel::PageModel() {
  restart();
}

void PageModel::restart() {
  outbox_.clear();
  error_.clear();
  tools_.clear();
  blood_.reset();
  waiting_tools_ = 0;
  held_.clear();
  lines_ = {};
  drawing_.clear();
  fine_.restart();
  replica_.emplace([this](const proto::Envelope& message) {
    const auto frame = wire::encode_envelope(message);
    if (outbox_.size() + frame->size() > kMostOutboxBytes) return false;
    outbox_.insert(outbox_.end(), frame->begin(), frame->end());
    return true;
  });
  shown_.emplace();
  built_version_ = 0;
}

bool PageModel::accept(const proto::Envelope& envelope, double now_ms, std::size_t bytes) {
  // A page without a fine surface shows all that matters: none ends for a wrong one.
  if (envelope.has_fine_surface_part()) {
    fine_.take(envelope.fine_surface_part());
    return true;
  }
  replica_->on_message(envelope, to_ns(now_ms), bytes);
  if (replica_->fault().ok()) return true;
  error_ = replica_->fault().error().message;
  return false;
}

bool PageModel::receive(BytesView message, double now_ms) {
  proto::Envelope envelope;
  const auto decoded = wire::decode_envelope(message, envelope);
  if (decoded.ok()) return accept(envelope, now_ms, message.size() + wire::kHeaderBytes);
  error_ = decoded.error().message;
  return false;
}

bool PageModel::receive_bare(std::uint32_t field, BytesView message, double now_ms) {
  proto::Envelope envelope;
  const auto parse = [&](google::protobuf::MessageLite* part) {
    return message.size() <= wire::kMaxDownstreamBytes &&
           part->ParseFromArray(message.data(), static_cast<int>(message.size()));
  };
  bool is_parsed = false;
  switch (field) {
    case proto::Envelope::kSurfaceFrameFieldNumber:
      is_parsed = parse(envelope.mutable_surface_frame());
      break;
    case proto::Envelope::kFrameStateFieldNumber:
      is_parsed = parse(envelope.mutable_frame_state());
      break;
    case proto::Envelope::kSurfaceChangeFieldNumber:
      is_parsed = parse(envelope.mutable_surface_change());
      break;
    case proto::Envelope::kSurfaceTopologyFieldNumber:
      is_parsed = parse(envelope.mutable_surface_topology());
      break;
    case proto::Envelope::kParticipantsFieldNumber:
      is_parsed = parse(envelope.mutable_participants());
      break;
    case proto::Envelope::kDrawingFieldNumber:
      is_parsed = parse(envelope.mutable_drawing());
      break;
    case proto::Envelope::kLessonStageFieldNumber:
      is_parsed = parse(envelope.mutable_lesson_stage());
      break;
    case proto::Envelope::kPointEventFieldNumber:
      is_parsed = parse(envelope.mutable_point_event());
      break;
    default:
      break;
  }
  if (is_parsed) return accept(envelope, now_ms, message.size());
  error_ = "a message of the recording cannot be read: the file is damaged";
  return false;
}

std::uint32_t PageModel::own_crc() const {
  const auto* newest = replica_->newest();
  return newest == nullptr ? 0 : wire::surface_crc(newest->surface);
}

void PageModel::build_surface(std::size_t triangle_budget) {
  const auto& topology = replica_->topology();
  smooth_.build(topology.rest_positions.size(), topology.triangles, topology.is_wound,
                triangle_budget);
  smooth_.smooth_borders(topology.rest_positions);
  smooth_.update(topology.rest_positions);
  built_version_ = replica_->topology_version();
  built_budget_ = triangle_budget;
  ++geometry_version_;
  attributes_.rest.resize(smooth_.vertex_count());
  smooth_.measure_rim(shape::kDeepMetres, attributes_.rim_distances);
  attributes_.parts.resize(smooth_.vertex_count());
  std::ranges::copy(shape::parts_of(look(), topology.rest_positions.size(), topology.triangles,
                                    topology.fixed_vertices),
                    attributes_.parts.begin());
  smooth_.extend_values(attributes_.parts);
  for (std::size_t i = 0; i < attributes_.rest.size(); ++i) {
    const Vec3f& p = smooth_.positions()[i];
    attributes_.rest[i] = {p.x, p.y, p.z,
                           4 * attributes_.parts[i] + shape::rim_of(attributes_.rim_distances[i],
                                                                    smooth_.is_wound()[i] != 0)};
  }
  attributes_.film.build(smooth_, topology.rest_positions);
}

void PageModel::update_figures() {
  attributes_.film.spread(smooth_, shown_->blood(), static_cast<float>(wire::kBloodLevelMetres));
  attributes_.lips.resize(smooth_.vertex_count());
  for (std::size_t i = 0; i < attributes_.lips.size(); ++i)
    attributes_.lips[i] = shape::lip_bytes(smooth_.lips()[i], attributes_.film.depths()[i]);
  const auto* newest = replica_->newest();
  if (newest == nullptr || !newest->has_state) return;  // its figures come in a moment
  waiting_tools_ = newest->figures.pace.rate.waiting_tools;
  blood_.reset();
  if (!newest->figures.blood) return;
  const wire::BloodFigures& figures = *newest->figures.blood;
  const auto ml = [](std::uint64_t nl) { return static_cast<double>(nl) * 1e-6; };
  blood_ = {.shed_ml = ml(figures.shed_nl),
            .on_surface_ml = ml(figures.on_surface_nl),
            .dripped_ml = ml(figures.dripped_nl),
            .sucked_ml = ml(figures.sucked_nl),
            .rate_ml_min = 60 * ml(figures.rate_nl_s),
            .open_vessels = static_cast<double>(figures.open_vessels)};
}

void PageModel::update_tools() {
  tools_.clear();
  for (const auto& tool : shown_->tools()) {
    PageTool out;
    out.slot = static_cast<float>(tool.slot.value);
    out.verb = static_cast<float>(static_cast<int>(tool.verb));
    out.has_claim = flag(tool.has_claim);
    out.is_silent = flag(tool.is_silent);
    out.is_inside = flag(tool.is_inside);
    out.contact_nodes = static_cast<float>(tool.contact_nodes);
    out.tip = tool.world_from_proxy.position;
    out.orientation = tool.world_from_proxy.orientation;
    out.hand = tool.world_from_tool.position;
    out.force_n = tool.force_n;
    out.torque_nm = tool.torque_nm;
    out.penetration_m = tool.penetration_m;
    tools_.push_back(out);
  }
}

void PageModel::update_overlay(Overlay overlay) {
  std::vector<tool::ToolShape> shapes;
  for (const auto& tool : shown_->tools()) {
    const auto* owner = replica_->told().find_participant(tool.slot.owner());
    const auto number = static_cast<std::size_t>(tool.slot.number());
    shapes.push_back(owner != nullptr && number < owner->tools.size() ? owner->tools[number]
                                                                      : tool::ToolShape{});
  }
  if (held_history_ != replica_->history_version()) held_.clear();
  held_history_ = replica_->history_version();
  // While hidden, too: which tissue a grasp took is seen when it takes it.
  held_.update(shown_->positions(), shown_->tools(), shapes);
  tints_.assign(smooth_.vertex_count(), PageTint{});
  overlay_.assign(smooth_.vertex_count(), {});
  if (overlay == Overlay::None) return;
  const auto& holdings = held_.holdings();
  const auto& regions = shown_->regions();
  for (std::size_t i = 0; i < smooth_.coarse_vertex_count(); ++i) {
    if (overlay == Overlay::Holds && i < holdings.size() &&
        holdings[i].owner != replica::kHeldByNobody)
      tints_[i] = tint_of(shape::colour_of_slot(holdings[i].owner),
                          holdings[i].is_grasp ? kFirmHoldStrength : kTouchStrength);
    if (overlay == Overlay::Regions && i < regions.size() && regions[i] != 0)
      tints_[i] = tint_of(shape::colour_of_region(regions[i]), kRegionStrength);
  }
  smooth_.extend_values(tints_);
  for (std::size_t i = 0; i < tints_.size(); ++i) overlay_[i] = bytes_of(tints_[i]);
}

void PageModel::update_fine() {
  const auto& topology = replica_->topology();
  const std::size_t coarse = smooth_.coarse_vertex_count();
  fine_.follow({topology.rest_positions, topology.triangles, topology.is_wound},
               replica_->topology_version());
  fine_.update(shown_->positions(), std::span(tints_).first(coarse),
               std::span(attributes_.film.depths()).first(coarse));
}

void PageModel::update_drawing() {
  lines_.update(*replica_, shown_->positions());
  drawing_.clear();
  for (const auto& line : lines_.lines()) {
    ribbon_.clear();
    for (const auto& point : line.points) ribbon_.push_back({point.position, point.normal});
    shape::add_ribbon(ribbon_, kLineHalfWidth, shape::colour_of_pointer(line.participant.value),
                      drawing_);
  }
}

const float* PageModel::lesson_target() {
  const auto& lesson = replica_->told().lesson();
  const auto* newest = replica_->newest();
  const auto target = lesson && newest != nullptr ? lesson->target_m(newest->tick) : std::nullopt;
  if (!target) return nullptr;
  target_ = {target->x, target->y, target->z};
  return target_.data();
}

const float* PageModel::attach(const Vec3f& place) {
  const auto& topology = replica_->topology();
  if (shown_->positions().size() != topology.rest_positions.size()) return nullptr;
  const auto found = replica::attach(place, topology, shown_->positions());
  if (found.triangle == replica::kNoTriangle) return nullptr;
  attached_ = {static_cast<float>(found.triangle), found.weight[0], found.weight[1]};
  return attached_.data();
}

bool PageModel::update(double now_ms, std::size_t triangle_budget, Overlay overlay) {
  shown_->update(*replica_, to_ns(now_ms));
  if (!shown_->is_valid()) return false;
  if (built_version_ != replica_->topology_version() || built_budget_ != triangle_budget)
    build_surface(triangle_budget);
  if (shown_->positions().size() != smooth_.coarse_vertex_count()) return false;
  smooth_.update(shown_->positions());
  update_figures();
  update_tools();
  pointers_.clear();
  for (const auto& pointer : replica_->told().pointers(to_ns(now_ms)))
    pointers_.push_back({static_cast<float>(pointer.participant.value), pointer.position_m});
  update_overlay(overlay);
  update_fine();
  update_drawing();
  return true;
}

const shape::MeshVertices& PageModel::make_tool(const tool::ToolShape& shape,
                                                shape::Colour colour) {
  instrument_ = shape::make_instrument(shape, colour);
  return instrument_.body;
}

shape::Lens PageModel::lens_of(std::uint8_t slot, const tool::ToolShape& shape) const {
  Pose world_from_tool;
  for (const auto& tool : shown_->tools())
    if (tool.slot.value == slot) world_from_tool = tool.world_from_proxy;
  return shape::lens_of(world_from_tool, shape);
}

shape::ClearEye PageModel::clear_eye(const Vec3f& eye, const Vec3f& forward, bool is_lens) const {
  const auto& topology = replica_->topology();
  if (shown_->positions().size() != topology.rest_positions.size()) return {0, shape::kLookMetres};
  return shape::clear_eye(eye, forward, shown_->positions(), topology.triangles,
                          is_lens ? shape::kScopeClearMetres : shape::kClearMetres);
}

const shape::MeshVertices& PageModel::make_hand_line(float length, shape::Colour colour) {
  mesh_ = shape::make_ghost(length, colour);
  return mesh_;
}

const shape::MeshVertices& PageModel::make_arrow(float length, float radius, shape::Colour colour) {
  mesh_ = shape::make_arrow(length, radius, colour);
  return mesh_;
}

}  // namespace trocar::wasm
