#pragma once

// This is the command line of trocar-igtl.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/net/way_in.h"
#include "client/slicer/publisher.h"
#include "client/slicer/studio.h"
#include "client/slicer/tracked_tools.h"
#include "common/base/result.h"

namespace trocar::slicer {

inline constexpr std::uint16_t kPort = 18944;  // where 3D Slicer looks

struct LinkOptions {
  std::string address = "127.0.0.1";
  std::uint16_t port = kPort;
  std::string server = "127.0.0.1:7690";
  net::WayIn way;
  double wait_s = 15;  // for a server that is not there yet
  std::string name;
  std::vector<TrackedTool> tools;  // at most kToolsPerHand
  Vec3d offset_m;                  // of the organ's centre in its scan, in the world's axes
  PublishOptions publish;
  StudioOptions studio;
  std::string label_map;  // a file to begin with; empty: none
  double seconds = 0;     // 0: until the end
  std::string ready_file;
  std::string log_level = "info";
};

// No value: --help or --version was asked for and printed.
Result<std::optional<LinkOptions>> parse_link_command_line(int argc, char** argv);

}  // namespace trocar::slicer
