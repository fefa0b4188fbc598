#pragma once

// The devices of this computer by name: what is there, what is missing and how to get it, and how
// to open one.
//
//   simulated:palpate,1Hz,3mm     hand_script.h says what else it does
//   haply                         or haply:ws://localhost:10001
//   forcedimension:0              the first that the maker's library sees; 0 may be left out
//   openhaptics:Default Device    the name in the maker's setup program; this one may be left out
//   spacemouse                    or spacemouse:/var/run/spnav.sock
//   gamepad                       the first one, or gamepad:/dev/input/event5
//   journal:FILE                  a recorded hand; name=NAME and tool=1 after commas choose it

#include <memory>
#include <string>
#include <vector>

#include "client/device/haptic_device.h"

namespace trocar::device {

// Says where the backends look.
struct DevicePlaces {
  std::string haply_url, spacemouse_socket, input_folder;
  std::vector<std::string> dhd_libraries, hd_libraries;
};
DevicePlaces usual_places();

struct ListedDevice {
  std::string name;  // open_device() takes it
  bool is_found = false;
  std::string text;  // one sentence: what it is, or what is missing and how to get it
};

// Takes no device away from a program that uses it, and takes at most some seconds.
std::vector<ListedDevice> list_devices(const DevicePlaces& places = usual_places());
// Returns text for a terminal: a line for each.
std::string device_table(const std::vector<ListedDevice>& devices);

// `name`: as above. An error is one line that says what to do.
Result<std::unique_ptr<HapticDevice>> open_device(const std::string& name,
                                                  const DevicePlaces& places = usual_places());

}  // namespace trocar::device
