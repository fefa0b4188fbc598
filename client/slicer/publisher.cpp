#include "client/slicer/publisher.h"

#include <fmt/format.h>

#include <algorithm>

namespace trocar::slicer {
namespace {

constexpr const char* kSurface = "Trocar_surface";
constexpr const char* kStatus = "Trocar";
constexpr const char* kForceEnding = "_force";
constexpr std::size_t kMostPersonBytes = 12;  // with _R_force, kMostNameBytes
constexpr std::uint64_t kStatusNs = 1'000'000'000;

std::uint64_t period_ns(double rate_hz) {
  return static_cast<std::uint64_t>(1e9 / rate_hz);
}

bool is_due(std::uint64_t now_ns, std::uint64_t last_ns, double rate_hz) {
  return last_ns == 0 || now_ns - last_ns >= period_ns(rate_hz);
}

}  // namespace

std::string tool_name(const std::string& participant, ToolSlot tool) {
  std::string name;
  for (const char c : participant) {
    const bool is_plain = (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') ||
                          (c >= 'a' && c <= 'z') || c == '-' || c == '_' || c == '.';
    name += is_plain ? c : '_';
  }
  if (name != participant || name.size() > kMostPersonBytes || name.empty()) {
    const auto number = fmt::format("~{}", static_cast<int>(tool.owner().value));
    name = name.substr(0, kMostPersonBytes - number.size()) + number;
  }
  return name + (tool.number() == 0 ? "_R" : "_L");
}

void Publisher::say(Condition condition, const std::string& text, std::uint64_t now_ns) {
  if (text == said_ && now_ns - said_ns_ < kStatusNs) return;
  said_ = text;
  said_ns_ = now_ns;
  board_.put("STATUS", status_message(kStatus, condition, text));
}

void Publisher::begin_anew() {
  for (const auto& key : tool_keys_) board_.take_down(key);
  tool_keys_.clear();
  board_.take_down("POLYDATA");
  shown_surface_.clear();
  has_frame_ = false;
}

void Publisher::update(const replica::Replica& replica, const Frames& frames,
                       std::uint64_t now_ns) {
  if (replica.newest() == nullptr) return;
  const auto& history = replica.history();
  const auto frame = std::find_if(history.rbegin(), history.rend(),
                                  [](const auto& each) { return each.has_state; });
  const bool is_new = frame != history.rend() && (!has_frame_ || frame->frame != shown_frame_);
  if (is_new && is_due(now_ns, tools_ns_, options_.rate_hz)) {
    tools_ns_ = now_ns;
    has_frame_ = true;
    shown_frame_ = frame->frame;
    show_tools(replica, *frame, frames);
  }
  if (!is_due(now_ns, surface_ns_, options_.surface_rate_hz)) return;
  if (replica.topology_version() == shown_version_ && replica.newest()->surface == shown_surface_)
    return;
  surface_ns_ = now_ns;
  show_surface(replica, frames);
}

void Publisher::show_tools(const replica::Replica& replica, const replica::SessionFrame& frame,
                           const Frames& frames) {
  std::set<std::string> keys;
  const auto put = [&](const char* type, const std::string& device, SharedBytes message) {
    const auto key = std::string(type) + " " + device;
    keys.insert(key);
    board_.put(key, std::move(message));
  };
  for (const auto& tool : frame.tools) {
    const auto* person = replica.told().find_participant(tool.slot.owner());
    if (person == nullptr) continue;
    const auto name = tool_name(person->name, tool.slot);
    put("TRANSFORM", name, transform_message(name, frames.to_ras(tool.world_from_proxy)));
    const Vec3f force = Frames::to_ras_axes(tool.force_n);
    const auto force_name = name + kForceEnding;
    put("STRING", force_name,
        text_message(force_name, fmt::format("{:.3f} N, R {:.3f} A {:.3f} S {:.3f}", length(force),
                                             force.x, force.y, force.z)));
    if (options_.has_sensor) put("SENSOR", name, force_message(name, force));
  }
  for (const auto& key : tool_keys_)
    if (!keys.contains(key)) board_.take_down(key);
  tool_keys_ = std::move(keys);
}

void Publisher::show_surface(const replica::Replica& replica, const Frames& frames) {
  const auto& topology = replica.topology();
  const auto& surface = replica.newest()->surface;
  points_mm_.clear();
  for (std::size_t i = 0; i < surface.size(); ++i)
    points_mm_.push_back(
        frames.to_ras_mm(topology.rest_positions[i] + wire::to_metres(surface[i])));
  board_.put("POLYDATA",
             surface_message(kSurface, {points_mm_, topology.triangles, topology.is_wound}));
  shown_surface_ = surface;
  shown_version_ = replica.topology_version();
}

}  // namespace trocar::slicer
