#include "client/app/client_options.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <map>

#include "client/ui/hud.h"
#include "common/base/size_option.h"
#include "common/base/version.h"
#include "common/command_line/command_line.h"
#include "common/command_line/limits.h"
#include "common/secure/join_code.h"
#include "common/tool/port.h"
#include "common/wire/role.h"

namespace trocar::app {
namespace {

constexpr const char* kExamples = R"(
Examples:
  trocar-client
      joins your own server on this machine, or asks which session; the mouse is an instrument
      (press H in the window for the keys)
  trocar-client --join trocar://192.168.1.20:7690/7K3M-9QXZ-4T2B-WN8C --role assistant
      joins a session on another machine with the link that its server printed
  trocar-client --list
      shows the sessions that announce themselves on this network
  trocar-client --role observer --headless --seconds 10 --screenshot out/last.png
      watches without a display and leaves its last picture
  trocar-client --no-render --name Left --script deploy/scenes/lift.toml --summary out/left.json
      a robot: a scripted hand, no picture
  trocar-client --device haply --device-motion 1.5
      holds an instrument with a haptic device (--list-devices shows which there are)
  trocar-client --device openhaptics --tool grasper --port 0,120,150
      holds laparoscopic jaws that pivot at a trocar there
  trocar-client --replay trocar-20261121T120000Z.mcap
      plays a recorded session with a free camera
  trocar-client --replay before.mcap --beside after.mcap
      plays two of them beside each other, with one time bar
  trocar-client --replay trocar-20261121T120000Z.mcap --device haply --feel Anna
      plays it, and the hand feels what Anna felt

Ends with the session, with --seconds, Ctrl-C, or the window. Exit codes: 0 ok, 2 command line,
3 bad file, 4 refused by the server, 5 server not reached or lost, or no display.
)";

std::string version_text() {
  return std::string("trocar-client ") + kVersion + ", sim_version " + std::to_string(kSimVersion) +
         ", protocol " + std::to_string(kProtocolMajor) + "." + std::to_string(kProtocolMinor);
}

Status parse_overlays(const std::vector<std::string>& names, Overlays& overlays) {
  if (names.empty()) return {};
  overlays = {};
  const std::map<std::string, bool Overlays::*> known = {{"regions", &Overlays::regions},
                                                         {"holds", &Overlays::holds},
                                                         {"arrows", &Overlays::arrows},
                                                         {"rate", &Overlays::rate}};
  for (const std::string& name : names) {
    if (name == "nothing" && names.size() == 1) continue;
    const auto found = known.find(name);
    if (found == known.end())
      return Error{
          ErrorCode::Usage,
          "--show: '" + name + "' is not one of regions, holds, arrows, rate (or nothing, alone)"};
    overlays.*found->second = true;
  }
  return {};
}

Status parse_view(const std::vector<double>& numbers, StartView& view) {
  if (numbers.empty()) return {};
  if (numbers.size() != 3 || !(std::abs(numbers[0]) <= 360) || !(std::abs(numbers[1]) <= 90) ||
      !(numbers[2] >= 0.2 && numbers[2] <= 5))
    return Error{ErrorCode::Usage,
                 "--view: give YAW,PITCH,ZOOM: degrees to turn (up to 360 and 90) and how much "
                 "nearer, 0.2 to 5, such as 30,-10,1.5"};
  view = {numbers[0], numbers[1], numbers[2]};
  return {};
}

Status parse_ports(const std::vector<std::string>& texts, std::vector<Vec3d>& ports_m) {
  for (const auto& text : texts) {
    const auto port_m = tool::parse_port(text);
    if (!port_m) return port_m.error();
    ports_m.push_back(*port_m);
  }
  return {};
}

Status parse_feels(const std::vector<std::string>& texts, std::vector<replay::HandInFile>& feels) {
  for (const auto& text : texts) {
    auto hand = replay::parse_hand_name(text);
    if (!hand) return Error{ErrorCode::Usage, "--feel: " + hand.error().message};
    feels.push_back(std::move(*hand));
  }
  return {};
}

// Says which ones there are.
Status check_tools(const ClientOptions& options) {
  for (const auto& name : options.tools) {
    if (tool::find_instrument(options.instruments(), name) != nullptr) continue;
    std::string known;
    for (const auto& instrument : options.instruments())
      known += (known.empty() ? "" : ", ") + instrument.name;
    return Error{ErrorCode::Usage, "--tool: " + name + " is none of " + known};
  }
  return {};
}

// Checks what belongs to devices, without opening them.
Error lacks_tools(const std::string& option, replica::Role role) {
  const bool may = wire::rights_of(role).may_have_tools;
  return {ErrorCode::Usage, option + ": " + wire::one_of(role) + " has no tools; " +
                                (may ? "add --with-tools" : "use --role surgeon or assistant")};
}

Status check_devices(const ClientOptions& options) {
  const std::size_t count = options.devices.size();
  const auto fits = [&](std::size_t given) { return given <= 1 || given == count; };
  const bool is_replay = !options.replay_file.empty();
  if (count == 0) {
    if (!options.trace_file.empty())
      return Error{ErrorCode::Usage, "--hand-trace: is of devices; give --device too"};
    if (!(options.ports_m.empty() && options.feels.empty()))
      return Error{ErrorCode::Usage, "--port, --feel: are of devices; give --device too"};
    if (options.tools.size() > 1)
      return Error{ErrorCode::Usage,
                   "--tool: give one; other instruments are in the window's tray"};
    if (!options.script_file.empty() && !options.tools.empty())
      return Error{ErrorCode::Usage, "--tool: a script says what its hands hold; leave it out"};
    return {};
  }
  if (count > 2)
    return Error{ErrorCode::Usage, "--device: " + std::to_string(count) +
                                       " are given, and a participant has two hands"};
  if (!options.script_file.empty())
    return Error{ErrorCode::Usage, "--device: does not go with --script; leave one out"};
  if (is_replay && options.feels.size() != count)
    return Error{ErrorCode::Usage,
                 "--device: with --replay, say with --feel NAME for each what it feels"};
  if (!is_replay && !options.feels.empty())
    return Error{ErrorCode::Usage, "--feel: is of a recording; give --replay too"};
  if (is_replay && !(options.tools.empty() && options.ports_m.empty()))
    return Error{ErrorCode::Usage, "--tool, --port: a recording takes no tools; leave them out"};
  if (!fits(options.tools.size()) || !fits(options.ports_m.size()))
    return Error{ErrorCode::Usage, "--tool, --port: give one, or one for each device"};
  if (!is_replay && !options.has_tools()) return lacks_tools("--device", options.role);
  return {};
}

std::string default_name() {
  const char* login = std::getenv("USER");
  const std::string base = login != nullptr && *login != '\0' ? login : "guest";
  return base.substr(0, 20) + "-" + std::to_string(getpid() % 10000);
}

Status check_beside(const ClientOptions& options) {
  if (options.beside_file.empty()) {
    if (!options.align && !options.has_own_views) return {};
    return Error{ErrorCode::Usage,
                 "--align, --own-views: are of two recordings; give --beside too"};
  }
  if (options.replay_file.empty())
    return Error{ErrorCode::Usage, "--beside: is a second recording; give --replay too"};
  if (!options.series_folder.empty())
    return Error{ErrorCode::Usage, "--beside: --pictures are of one recording; leave one out"};
  if (!options.devices.empty())
    return Error{ErrorCode::Usage, "--beside: a device feels one recording; leave one out"};
  if (options.display == Display::None)
    return Error{ErrorCode::Usage, "--beside: --no-render draws nothing; use --headless"};
  return {};
}

Status check(const ClientOptions& options) {
  if (!options.replay_file.empty() && !options.script_file.empty())
    return Error{ErrorCode::Usage, "--replay and --script: a recording takes no tools; choose one"};
  if (const auto beside = check_beside(options); !beside) return beside;
  if (!options.series_folder.empty() && options.replay_file.empty())
    return Error{ErrorCode::Usage, "--pictures: is of a recording; give --replay too"};
  if (const auto tools = check_tools(options); !tools) return tools;
  if (const auto devices = check_devices(options); !devices) return devices;
  if (!options.script_file.empty() && !options.has_tools())
    return lacks_tools("--script", options.role);
  if (options.brings_tools && !wire::rights_of(options.role).may_have_tools)
    return lacks_tools("--with-tools", options.role);
  if (options.is_insecure && !(options.join.empty() && options.ca_file.empty()))
    return Error{ErrorCode::Usage,
                 "--insecure-loopback: goes with neither --join nor --ca; leave one out"};
  if ((options.mark_at >= 0 || options.return_at >= 0) && !wire::rights_of(options.role).may_mark)
    return Error{ErrorCode::Usage,
                 "--mark-at, --return-at: marks are an instructor's; use --role instructor"};
  if (options.display == Display::None && !options.screenshot_file.empty())
    return Error{ErrorCode::Usage, "--screenshot: --no-render draws nothing; use --headless"};
  return {};
}

// These options are read further once all are there.
struct GivenTexts {
  std::string role = "surgeon", size;
  std::map<std::string, replica::Role> roles;  // by name
  bool is_headless = false, draws_nothing = false;
  std::vector<double> view;
  std::vector<std::string> overlays, ports, feels;
  std::string instruments, align;
  const CLI::Option* server = nullptr;
};

std::vector<std::string> role_names() {
  std::vector<std::string> names;
  for (const auto& known : wire::kRoles) names.emplace_back(known.name);
  return names;
}

void add_session_options(CLI::App& app, ClientOptions& options, GivenTexts& more) {
  app.add_option("--join", options.join,
                 "join code or link, as the server printed it; not needed for your own server on "
                 "this machine")
      ->type_name("CODE|LINK");
  more.server =
      app.add_option("--server", options.server, "where the session is, if no link says it")
          ->type_name("HOST:PORT")
          ->capture_default_str();
  app.add_flag("--list", options.lists_sessions,
               "list the sessions that announce themselves on the local network, and exit; "
               "--seconds says how long to look [3]");
  app.add_flag("--choose", options.chooses,
               "show the start screen, even if your own server runs on this machine");
  app.add_option("--ca", options.ca_file,
                 "trust servers that this CA (PEM) vouches for, instead of the code's first half")
      ->type_name("FILE");
  app.add_flag("--insecure-loopback", options.is_insecure,
               "without TLS and codes, for tests; servers on this machine only");
  app.add_flag("!--no-datagrams", options.wants_datagrams,
               "frames and hands over the TCP stream alone");
  app.add_option("--wait", options.wait_s, "how long to try while no server is there yet")
      ->type_name("S")
      ->check(command_line::from_to(0, 3600))
      ->capture_default_str();
  app.add_option("--name", options.name, "how others see you, unique in the session")
      ->type_name("NAME");
  app.add_option("--role", more.role,
                 "surgeon, assistant (with tools), instructor, observer (watch)")
      ->check(command_line::one_of(role_names()))
      ->type_name("ROLE")
      ->capture_default_str();
  app.add_flag(
      "--with-tools", options.brings_tools,
      "as instructor: hold instruments, too, to show how, and to take over those of others");
}

void add_picture_options(CLI::App& app, ClientOptions& options, GivenTexts& more) {
  app.add_flag("--headless", more.is_headless, "draw into memory, needs no display");
  app.add_flag("--no-render", more.draws_nothing, "draw nothing: a robot or a watcher by program");
  app.add_option("--size", more.size, "of the picture [1280x720]")->type_name("WxH");
  app.add_option("--scale", options.scale,
                 "how large words and panels are, as far as they fit [as the monitor says]")
      ->type_name("FACTOR")
      ->check(command_line::from_to(double{ui::kLeastScale}, double{ui::kMostScale}));
  app.add_option("--fps", options.pictures_per_second,
                 "pictures per second [window 60, headless 15, fewer in software]")
      ->type_name("N")
      ->check(command_line::from_to(1, 240));
  app.add_option(
         "--show", more.overlays,
         "what is drawn over the picture: regions, holds, arrows, rate, or nothing; keys change "
         "it [nothing]")
      ->type_name("A,B")
      ->delimiter(',');
  app.add_option("--view", more.view, "turn the camera at first, degrees, and go nearer [0,0,1]")
      ->type_name("YAW,PITCH,ZOOM")
      ->delimiter(',');
  app.add_option("--see-with", options.sees_with,
                 "see through this participant's endoscope; in a recording also from behind the "
                 "tip of another tool")
      ->type_name("NAME");
  app.add_option("--screenshot", options.screenshot_file, "write a picture (PNG)")
      ->type_name("FILE");
  app.add_option("--screenshot-at", options.screenshot_at,
                 "seconds after joining at which it is taken [the last picture]")
      ->type_name("S")
      ->check(command_line::from_to(0, 1e6));
}

void add_time_options(CLI::App& app, ClientOptions& options) {
  app.add_option("--seconds", options.seconds, "leave after this many seconds")
      ->type_name("N")
      ->check(command_line::from_to(0, 1e9));
  app.add_option("--answer-at", options.answer_at,
                 "in a lesson: say that it is here so many simulated seconds after joining")
      ->type_name("S")
      ->check(command_line::from_to(0, 1e6));
  app.add_option("--mark-at", options.mark_at,
                 "as instructor: mark the organ so many simulated seconds after joining")
      ->type_name("S")
      ->check(command_line::from_to(0, 1e6));
  app.add_option("--return-at", options.return_at, "as instructor: return it to the mark then")
      ->type_name("S")
      ->check(command_line::from_to(0, 1e6));
}

void add_hand_options(CLI::App& app, ClientOptions& options, GivenTexts& more) {
  app.add_option("--script", options.script_file, "scripted hand instead of the mouse (TOML)")
      ->type_name("FILE");
  app.add_option("--device", options.devices,
                 "hold a tool with a haptic device, and feel it; twice: one for each hand "
                 "[the mouse]")
      ->type_name("NAME")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app.add_flag("--list-devices", options.lists_devices,
               "list the devices of this computer and what is missing for others, and exit");
  std::string tool_text = "what a hand holds first; twice: one for each device [all]:";
  for (const auto& instrument : tool::instruments())
    tool_text += " " + instrument.name + " (" + instrument.text + ")";
  app.add_option("--tool", options.tools, tool_text)
      ->type_name("NAME")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app.add_option("--instruments", more.instruments,
                 "instruments of your own instead of these (TOML, as common/tool/instruments.toml)")
      ->type_name("FILE");
  app.add_option("--hands", options.mouse_hands, "hands of a person with a mouse")
      ->check(command_line::whole_from_to(1, kToolsPerHand))
      ->capture_default_str();
  app.add_option("--port", more.ports,
                 "point that a device's shaft passes, mm, as a trocar holds a laparoscopic "
                 "instrument; twice: one for each [free]")
      ->type_name("X,Y,Z")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app.add_option("--device-motion", options.device_motion,
                 "how far the tool goes where the device goes 1")
      ->type_name("SCALE")
      ->check(command_line::from_to(0.01, 20))
      ->capture_default_str();
  app.add_option("--device-force", options.device_force,
                 "the force on the hand where the tool feels 1")
      ->type_name("SCALE")
      ->check(command_line::from_to(0, 10))
      ->capture_default_str();
  app.add_option("--hand-trace", options.trace_file,
                 "write what each device did and felt, a row for each millisecond (CSV)")
      ->type_name("FILE");
}

void add_replay_options(CLI::App& app, ClientOptions& options, GivenTexts& more) {
  app.add_option("--replay", options.replay_file, "play a recorded session (.mcap)")
      ->type_name("FILE");
  app.add_option("--beside", options.beside_file,
                 "with --replay: a second recording (.mcap), beside the first in one window")
      ->type_name("FILE");
  app.add_option("--align", more.align,
                 "with --beside: let both begin at their start, or each stage of a lesson begin "
                 "together: start, stage [stage where both have it]")
      ->check(command_line::one_of({"start", "stage"}))
      ->type_name("BY");
  app.add_flag("--own-views", options.has_own_views,
               "with --beside: turn each of the two by itself");
  app.add_option("--pictures", options.series_folder,
                 "with --replay: write numbered pictures (PNG) of it instead of playing it")
      ->type_name("FOLDER");
  app.add_option("--from", options.series_from_s, "with --pictures: first second of the recording")
      ->type_name("S")
      ->check(command_line::from_to(0, 1e6));
  app.add_option("--to", options.series_to_s, "with --pictures: last second; 0: the end")
      ->type_name("S")
      ->check(command_line::from_to(0, 1e6));
  app.add_option("--rate", options.series_rate,
                 "with --pictures: of them per second of the recording")
      ->type_name("N")
      ->check(command_line::from_to(0.1, 120))
      ->capture_default_str();
  app.add_option("--feel", more.feels,
                 "with --replay and --device: feel what this participant felt, with tool 0 or 1; "
                 "twice: one for each device")
      ->type_name("NAME[,tool=N]")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app.add_option("--feel-pull", options.feel_pull_n_m,
                 "stiffness of the spring that leads the hand along with --feel, N/m; 0: none")
      ->type_name("N/M")
      ->check(command_line::from_to(0, 500))
      ->capture_default_str();
}

Status read_further(const GivenTexts& more, ClientOptions& options) {
  options.role = more.roles.at(more.role);
  if (!options.join.empty()) {
    const auto invitation = secure::parse_invitation(options.join);
    if (!invitation) return Error{ErrorCode::Usage, "--join: " + invitation.error().message};
    if (more.server->count() == 0 && !invitation->server.empty())
      options.server = invitation->server;
  }
  options.is_told_where = !options.join.empty() || more.server->count() > 0 ||
                          !options.replay_file.empty() || !options.script_file.empty() ||
                          options.is_insecure;
  if (more.draws_nothing)
    options.display = Display::None;
  else if (more.is_headless)
    options.display = Display::Headless;
  options.is_told_who = !options.name.empty();
  if (options.name.empty()) options.name = default_name();
  if (!more.size.empty()) {
    const auto size = parse_size(more.size, 64, 64);
    if (!size) return size.error();
    options.size = {size->first, size->second};
  }
  if (const auto parsed = parse_overlays(more.overlays, options.overlays); !parsed) return parsed;
  if (const auto parsed = parse_view(more.view, options.view); !parsed) return parsed;
  if (const auto parsed = parse_ports(more.ports, options.ports_m); !parsed) return parsed;
  if (!more.align.empty())
    options.align = more.align == "stage" ? replay::Alignment::Stage : replay::Alignment::Start;
  if (const auto parsed = parse_feels(more.feels, options.feels); !parsed) return parsed;
  if (!more.instruments.empty()) {
    auto table = tool::read_instruments(more.instruments);
    if (!table) return Error{table.error().code, "--instruments: " + table.error().message};
    options.own_instruments = std::move(*table);
  }
  return check(options);
}

}  // namespace

std::span<const tool::Instrument> ClientOptions::instruments() const {
  return own_instruments.empty() ? tool::instruments() : own_instruments;
}

const tool::Instrument& ClientOptions::tool_of(std::size_t device) const {
  if (tools.empty()) return instruments().front();
  return *tool::find_instrument(instruments(), tools[std::min(device, tools.size() - 1)]);
}

std::optional<Vec3d> ClientOptions::port_of(std::size_t device) const {
  if (ports_m.empty()) return std::nullopt;
  return ports_m[std::min(device, ports_m.size() - 1)];
}

Result<std::optional<ClientOptions>> parse_client_command_line(int argc, char** argv) {
  ClientOptions options;
  GivenTexts more;
  for (const auto& known : wire::kRoles) more.roles[known.name] = known.role;
  CLI::App app("Takes part in a session, watches one, or plays a recorded one.", "trocar-client");
  app.footer(kExamples);
  app.set_version_flag("--version", version_text());
  add_session_options(app, options, more);
  add_picture_options(app, options, more);
  add_time_options(app, options);
  add_hand_options(app, options, more);
  add_replay_options(app, options, more);
  app.add_option("--summary", options.summary_file, "write figures of the run as JSON at the end")
      ->type_name("FILE");
  app.add_option("--corrupt-frame", options.corrupt_frame, "")->group("");
  app.add_option("--log-level", options.log_level, "error, warn, info, debug or off")
      ->capture_default_str();
  const auto parsed = command_line::parse_command_line(app, argc, argv);
  if (!parsed) return parsed.error();
  if (!*parsed) return std::optional<ClientOptions>();
  if (const auto read = read_further(more, options); !read) return read.error();
  return std::optional<ClientOptions>(std::move(options));
}

}  // namespace trocar::app
