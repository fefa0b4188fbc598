#pragma once

// Writes and reads the messages of the Haply Inverse Service (JSON 3.1, as of version 3.5): what it
// says is outside data.
//
// Frame of the device: x right, y away from the person, z up, origin in its base; the hand is at
// home at (0, -0.12, 0.15) m. Ours has its origin there: (x, y, z) = (x', z' - 0.15, -y' - 0.12).

#include <optional>
#include <string>
#include <string_view>

#include "client/device/haptic_device.h"

namespace trocar::device {

// More than the inventory of ten devices; a longer message ends the connection.
inline constexpr std::size_t kHaplyMessageBytes = 256 * 1024;

struct HaplyState {
  std::string device_id;  // empty: the service has no Inverse3
  DeviceReading reading;  // its time is not set, and its numbers are not checked
};

// `device_id`: which Inverse3, empty: the first one. An error if it is no message of this protocol.
Result<HaplyState> read_haply_state(std::string_view json, const std::string& device_id);

// A force in our frame. `is_first`: names this program to the service.
std::string haply_command(const std::string& device_id, const Vec3d& force_n, bool is_first);

// The text as one whole frame of a client's WebSocket (RFC 6455 section 5.2), for a socket to be
// sent as it is. At most 64 kB.
std::string websocket_frame(std::string_view text);

struct HaplyAddress {
  std::string host, port;
};
// Reads "ws://localhost:10001"; returns nothing if it is no such address.
std::optional<HaplyAddress> parse_haply_address(std::string_view url);

}  // namespace trocar::device
