#include "client/device/device_list.h"

#include <algorithm>
#include <charconv>
#include <string_view>

#include "client/device/device_checks.h"
#include "client/device/forcedimension_device.h"
#include "client/device/gamepad_device.h"
#include "client/device/haply_device.h"
#include "client/device/journal_device.h"
#include "client/device/openhaptics_device.h"
#include "client/device/simulated_device.h"
#include "client/device/spacemouse_device.h"
#include "common/base/printable.h"

namespace trocar::device {
namespace {

using Opened = Result<std::unique_ptr<HapticDevice>>;

constexpr double kSearchSpeed_m_s = 0.02;  // of a hand that begins in front of the organ

Opened open_simulated(const std::string& parameters) {
  auto script = HandScript::parse(parameters.empty() ? "palpate" : parameters);
  if (!script) return script.error();
  return std::unique_ptr<HapticDevice>(std::make_unique<SimulatedDevice>(
      std::move(*script), monotonic_us, HandModel{.search_m_s = kSearchSpeed_m_s}));
}

Opened open_journal(const std::string& parameters) {
  const auto chosen = replay::parse_hand_in_file(parameters);
  if (!chosen) return chosen.error();
  auto hand = replay::read_recorded_hand(chosen->path, chosen->name, chosen->tool);
  if (!hand) return hand.error();
  return std::unique_ptr<HapticDevice>(
      std::make_unique<JournalDevice>(std::move(*hand), monotonic_us));
}

Opened open_forcedimension(const std::string& index, const DevicePlaces& places) {
  int number = 0;
  const auto* end = index.data() + index.size();
  const auto [stop, failure] = std::from_chars(index.data(), end, number);
  if (!index.empty() && (failure != std::errc{} || stop != end))
    return Error{ErrorCode::Usage, "\"" + printable(index, 40) +
                                       "\" is no number of a device, write for example "
                                       "forcedimension:0"};
  return ForceDimensionDevice::open(places.dhd_libraries, number);
}

Opened open_gamepad(const std::string& path, const DevicePlaces& places) {
  if (!path.empty()) return GamepadDevice::open(path, monotonic_us);
  const auto found = GamepadDevice::find(places.input_folder);
  if (found.empty())
    return Error{ErrorCode::ResourceMissing,
                 "no gamepad is found in " + places.input_folder +
                     ", plug one in, or join the group of its file (usually input)"};
  return GamepadDevice::open(found.front(), monotonic_us);
}

// A device that was opened for the list is closed at once.
ListedDevice listed(const std::string& name, const Opened& opened) {
  return {name, opened.ok(), opened.ok() ? (*opened)->description() : opened.error().message};
}

ListedDevice list_forcedimension(const DevicePlaces& places) {
  const auto count = ForceDimensionDevice::count(places.dhd_libraries);
  ListedDevice entry{"forcedimension", count.ok() && *count > 0, ""};
  if (!count)
    entry.text = count.error().message;
  else if (*count == 0)
    entry.text =
        "The library is there but sees no device, plug one in and allow its USB device to this "
        "user by a udev rule";
  else
    entry.text = std::to_string(*count) + " of them, numbered from 0";
  return entry;
}

// Only opening tells whether a device is there, and that would move its motors.
ListedDevice list_openhaptics(const DevicePlaces& places) {
  const auto status = OpenHapticsDevice::check_library(places.hd_libraries);
  return {"openhaptics", status.ok(),
          status.ok() ? "The library is there; whether a device is shows when it is opened"
                      : status.error().message};
}

ListedDevice list_gamepads(const DevicePlaces& places) {
  const auto found = GamepadDevice::find(places.input_folder);
  if (found.empty()) return listed("gamepad", open_gamepad("", places));
  std::string text;
  for (const auto& path : found) text += (text.empty() ? "" : " ") + path;
  return {"gamepad", true, text};
}

}  // namespace

DevicePlaces usual_places() {
  return {.haply_url = HaplyDevice::kUrl,
          .spacemouse_socket = SpaceMouseDevice::kSocket,
          .input_folder = "/dev/input",
          .dhd_libraries = ForceDimensionDevice::library_names(),
          .hd_libraries = OpenHapticsDevice::library_names()};
}

std::vector<ListedDevice> list_devices(const DevicePlaces& places) {
  return {{"simulated", true, "A hand that is calculated, for example simulated:palpate,1Hz,3mm"},
          {"journal", true, "A hand of a recording, for example journal:session.mcap,name=Anna"},
          listed("haply", HaplyDevice::open(places.haply_url)),
          list_forcedimension(places),
          list_openhaptics(places),
          listed("spacemouse", SpaceMouseDevice::open(places.spacemouse_socket, monotonic_us)),
          list_gamepads(places)};
}

std::string device_table(const std::vector<ListedDevice>& devices) {
  std::string table;
  for (const auto& device : devices) {
    std::string name = device.name;
    name.resize(std::max<std::size_t>(name.size() + 1, 16), ' ');
    table += name + (device.is_found ? "found    " : "missing  ") + device.text + "\n";
  }
  return table;
}

Opened open_device(const std::string& name, const DevicePlaces& places) {
  const auto colon = std::min(name.find(':'), name.size());
  const std::string kind = name.substr(0, colon);
  const std::string which = name.substr(std::min(colon + 1, name.size()));
  if (kind == "simulated") return open_simulated(which);
  if (kind == "journal") return open_journal(which);
  if (kind == "haply") return HaplyDevice::open(which.empty() ? places.haply_url : which);
  if (kind == "forcedimension") return open_forcedimension(which, places);
  if (kind == "openhaptics")
    return OpenHapticsDevice::open(places.hd_libraries,
                                   which.empty() ? OpenHapticsDevice::kDefaultDevice : which);
  if (kind == "spacemouse")
    return SpaceMouseDevice::open(which.empty() ? places.spacemouse_socket : which, monotonic_us);
  if (kind == "gamepad") return open_gamepad(which, places);
  return Error{ErrorCode::Usage, "\"" + printable(kind, 40) +
                                     "\" is no kind of device, choose simulated, journal, haply, "
                                     "forcedimension, openhaptics, spacemouse or gamepad"};
}

}  // namespace trocar::device
