#pragma once

// This is the command line of trocar-client.

#include <optional>
#include <string>
#include <vector>

#include "client/render/gl_context.h"
#include "client/replay/paired_source.h"
#include "client/replay/recorded_hand.h"
#include "client/replica/session_view.h"
#include "common/base/result.h"
#include "common/math/vec3.h"
#include "common/tool/instrument.h"

namespace trocar::app {

enum class Display : std::uint8_t { Window, Headless, None };

// These overlays are drawn over the picture; keys switch them.
struct Overlays {
  bool regions = false, holds = false, arrows = false, rate = false;

  bool operator==(const Overlays&) const = default;
};
// How the camera first stands: turned from the front, and nearer (zoom above 1) than usual.
struct StartView {
  double yaw_deg = 0, pitch_deg = 0, zoom = 1;
};

struct ClientOptions {
  std::string server = "127.0.0.1:7690";
  std::string join;            // code or link; empty: from the link file
  bool is_told_where = false;  // which session is meant, so that nobody need ask
  bool is_told_who = false;    // the name was given
  bool chooses = false;        // the start screen asks even if a server runs on this machine
  std::string ca_file;         // empty: the code says whose certificate it must be
  bool is_insecure = false;    // without TLS, on this machine only
  bool wants_datagrams = true;
  double wait_s = 15;  // for a server that is not there yet
  std::string name;    // empty: made from the login name and the process
  replica::Role role = replica::Role::Surgeon;
  bool brings_tools = false;  // of a role that may have tools, and need not
  Display display = Display::Window;
  render::Size size{1280, 720};
  double pictures_per_second = 0;  // 0: 60 in a window, 15 headless
  double scale = 0;                // of words and panels; 0: as the monitor says
  Overlays overlays;
  StartView view;
  std::string sees_with;  // the name of who holds the tool that one sees with; empty: own eyes
  std::string screenshot_file;
  double screenshot_at = -1;            // seconds after joining; < 0: the last picture
  double seconds = 0;                   // 0: until the session ends
  double answer_at = -1;                // of a lesson: likewise
  double mark_at = -1, return_at = -1;  // instructor: seconds after joining; < 0: not
  std::string script_file, replay_file, summary_file;
  std::string beside_file;                 // a second recording beside the first; empty: none
  std::optional<replay::Alignment> align;  // of the two; nothing: by stages where they have them
  bool has_own_views = false;              // each of the two is turned by itself
  std::string series_folder;               // for pictures of the recording; empty: it is played
  double series_from_s = 0, series_to_s = 0, series_rate = 25;  // to 0: the end
  std::string trace_file;                                       // of what devices did and felt
  std::vector<std::string> devices;  // as device::open_device; empty: the mouse or the script
  std::vector<tool::Instrument> own_instruments;  // empty: those of tool::instruments()
  // There is one for each device, or one for all; empty: the table's first, and no port.
  std::vector<std::string> tools;
  std::vector<Vec3d> ports_m;
  std::vector<replay::HandInFile> feels;  // of the recording: one for each device
  double feel_pull_n_m = 80;
  double device_motion = 1;         // of the tool over the device
  double device_force = 1;          // of the device over the tool
  bool lists_devices = false;       // of this computer, instead of taking part
  std::uint64_t corrupt_frame = 0;  // hidden: damages the n-th delta, to prove healing
  bool lists_sessions = false;      // of the local network, instead of taking part in one
  std::string log_level = "info";

  int mouse_hands = 2;  // of a person with a mouse
  bool has_tools() const { return replica::has_tools(role) || brings_tools; }
  std::span<const tool::Instrument> instruments() const;
  // Returns one of instruments(), for a device or, 0, a mouse.
  const tool::Instrument& tool_of(std::size_t device) const;
  std::optional<Vec3d> port_of(std::size_t device) const;
};

// No value: --help or --version was asked for and printed.
Result<std::optional<ClientOptions>> parse_client_command_line(int argc, char** argv);

}  // namespace trocar::app
