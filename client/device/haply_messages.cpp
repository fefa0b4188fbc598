#include "client/device/haply_messages.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "common/base/printable.h"

namespace trocar::device {
namespace {

using nlohmann::json;

constexpr Vec3d kHome{0, 0.15, 0.12};  // in our directions, from the base
constexpr std::size_t kMostIdBytes = 64;

Error not_understood(const std::string& what) {
  return {ErrorCode::BadMessage, "the Haply service says what is not understood (" + what +
                                     "), update it to version 3.5 or newer"};
}

// The member if `object` is an object that has it.
const json* find_member(const json& object, const char* name) {
  if (!object.is_object()) return nullptr;
  const auto found = object.find(name);
  return found == object.end() ? nullptr : &*found;
}

std::optional<Vec3d> vector_in(const json& object, const char* name) {
  const json* member = find_member(object, name);
  if (member == nullptr) return std::nullopt;
  std::array<double, 3> values{};
  for (std::size_t i = 0; i < 3; ++i) {
    static constexpr std::array kNames{"x", "y", "z"};
    const json* value = find_member(*member, kNames[i]);
    if (value == nullptr || !value->is_number()) return std::nullopt;
    values[i] = value->get<double>();
  }
  return Vec3d{values[0], values[2], -values[1]};
}

std::optional<Quatf> quaternion_in(const json& object) {
  const auto axis = vector_in(object, "orientation");
  const json* member = find_member(object, "orientation");
  const json* w = member == nullptr ? nullptr : find_member(*member, "w");
  if (!axis || w == nullptr || !w->is_number()) return std::nullopt;
  const Vec3f v = to_float(*axis);
  return Quatf{v.x, v.y, v.z, w->get<float>()};
}

bool is_true(const json* value) {
  return value != nullptr && value->is_boolean() && value->get<bool>();
}

// A grip has the orientation of the hand, and buttons; with a cable it has only one.
void read_grip(const json& message, const char* kind, DeviceReading& reading) {
  const json* grips = find_member(message, kind);
  if (grips == nullptr || !grips->is_array() || grips->empty()) return;
  const json* state = find_member(grips->front(), "state");
  if (state == nullptr) return;
  if (const auto orientation = quaternion_in(*state)) reading.orientation = *orientation;
  if (is_true(find_member(*state, "button"))) reading.buttons |= 1;
  const json* buttons = find_member(*state, "buttons");
  if (buttons == nullptr) return;
  std::uint32_t bit = 1;
  for (const char* name : {"a", "b", "c"}) {
    if (is_true(find_member(*buttons, name))) reading.buttons |= bit;
    bit <<= 1;
  }
}

const json* device_in(const json& devices, const std::string& device_id, std::string& found_id) {
  for (const json& device : devices) {
    const json* id = find_member(device, "device_id");
    if (id == nullptr || !id->is_string()) continue;
    const auto& text = id->get_ref<const std::string&>();
    if (text.size() > kMostIdBytes || !is_printable(text)) continue;
    if (!device_id.empty() && text != device_id) continue;
    found_id = text;
    return &device;
  }
  return nullptr;
}

}  // namespace

Result<HaplyState> read_haply_state(std::string_view text, const std::string& device_id) {
  const json message = json::parse(text, nullptr, false);
  if (!message.is_object()) return not_understood("no JSON object");
  const json* devices = find_member(message, "inverse3");
  HaplyState state;
  if (devices == nullptr) return state;
  // Version 3.0 names its devices by the members of an object.
  if (!devices->is_array()) return not_understood("inverse3 is no list");
  const json* device = device_in(*devices, device_id, state.device_id);
  if (device == nullptr) return state;
  const json* own = find_member(*device, "state");
  if (own == nullptr) return not_understood("a device has no state");
  const auto position = vector_in(*own, "cursor_position");
  const auto velocity = vector_in(*own, "cursor_velocity");
  if (!position || !velocity) return not_understood("no position or no velocity");
  state.reading.position_m = *position - kHome;
  state.reading.velocity_m_s = *velocity;
  read_grip(message, "verse_grip", state.reading);
  read_grip(message, "wireless_verse_grip", state.reading);
  return state;
}

std::string haply_command(const std::string& device_id, const Vec3d& force_n, bool is_first) {
  json command;
  if (is_first) command["session"]["configure"]["profile"]["name"] = "Trocar";
  const json values = {{"x", force_n.x}, {"y", -force_n.z}, {"z", force_n.y}};
  command["inverse3"] = json::array(
      {{{"device_id", device_id}, {"commands", {{"set_cursor_force", {{"values", values}}}}}}});
  return command.dump(-1, ' ', false, json::error_handler_t::replace);
}

std::string websocket_frame(std::string_view text) {
  constexpr unsigned char kWholeText = 0x81, kIsMasked = 0x80, kHasTwoBytes = 126;
  constexpr std::array<unsigned char, 4> kMask{0x5a, 0xc3, 0x3c, 0xa5};  // any will do
  std::string frame;
  const auto add = [&](std::size_t byte) { frame += static_cast<char>(byte & 0xff); };
  add(kWholeText);
  if (text.size() < kHasTwoBytes) {
    add(kIsMasked | text.size());
  } else {
    add(kIsMasked | kHasTwoBytes);
    add(text.size() >> 8);
    add(text.size());
  }
  for (const auto byte : kMask) add(byte);
  for (std::size_t i = 0; i < text.size(); ++i)
    add(static_cast<unsigned char>(text[i]) ^ kMask[i % kMask.size()]);
  return frame;
}

std::optional<HaplyAddress> parse_haply_address(std::string_view url) {
  constexpr std::string_view kScheme = "ws://";
  if (!url.starts_with(kScheme)) return std::nullopt;
  url.remove_prefix(kScheme.size());
  if (url.ends_with('/')) url.remove_suffix(1);
  const auto colon = url.rfind(':');
  const auto host = url.substr(0, colon);
  const auto port = colon == std::string_view::npos ? "10001" : url.substr(colon + 1);
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  const bool is_port = !port.empty() && port.size() <= 5 && std::ranges::all_of(port, is_digit);
  if (host.empty() || host.size() > 255 || !is_port || !is_printable(host)) return std::nullopt;
  return HaplyAddress{std::string(host), std::string(port)};
}

}  // namespace trocar::device
