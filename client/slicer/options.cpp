#include "client/slicer/options.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>

#include "common/base/ids.h"
#include "common/base/printable.h"
#include "common/base/version.h"
#include "common/command_line/command_line.h"
#include "common/command_line/limits.h"
#include "common/secure/join_code.h"
#include "common/secure/loopback.h"
#include "common/tool/instrument.h"

namespace trocar::slicer {
namespace {

constexpr const char* kExamples = R"(
Examples:
  trocar-igtl
      shows 3D Slicer your own session on this machine: tools, surface, forces. In Slicer, in the
      module OpenIGTLinkIF: +, Type Client, Hostname localhost, Port 18944, check Active
  trocar-igtl --hold Stylus=probe
      the transform Stylus that Slicer sends moves a probe, which presses; in OpenIGTLinkIF, I/O
      Configuration, add it below OUT
  trocar-igtl --hold Left=grasper --hold Right=scissors --name Slicer
      two instruments; a text node Left that says grasp closes the jaws, one that says none opens
      them
  trocar-igtl --serve
      no session yet: a label map that Slicer sends becomes an organ, and a session begins with it,
      in which trocar-client takes part; a model that it sends is the fine surface
  trocar-igtl --serve --label-map scan.nii.gz --labels 1:liver,2:tumour --nodes 4000
      begins with a file
  trocar-igtl --folder organs --join trocar://192.168.1.20:7690/7K3M-9QXZ-4T2B-WN8C
      watches a session on another machine; label maps become organs in that folder

Lengths are mm and places RAS, as in Slicer. OpenIGTLink knows neither codes nor encryption: who
reaches the port sees all, and moves what --hold names. Exit codes: 0 ok, 2 command line, 3 bad
file, 4 refused by the server, 5 port taken, server not reached or lost.
)";

// These options are read further once all are there.
struct Texts {
  std::string listen = "127.0.0.1:" + std::to_string(kPort), role;
  std::vector<std::string> holds;
  std::string origin;
  const CLI::Option* server = nullptr;
};

// Reads A,B,C; false if it is not three numbers of at most 10 m.
bool read_place(const std::string& text, Vec3d& mm) {
  const char* at = text.data();
  const char* const end = at + text.size();
  for (double* number : {&mm.x, &mm.y, &mm.z}) {
    const auto [stop, failure] = std::from_chars(at, end, *number);
    const bool is_last = number == &mm.z;
    if (failure != std::errc{} || !(std::abs(*number) <= 1e4)) return false;
    if (is_last ? stop != end : stop == end || *stop != ',') return false;
    at = stop + (is_last ? 0 : 1);
  }
  return true;
}

Status read_listen(const std::string& text, LinkOptions& options) {
  const auto colon = text.rfind(':');
  const char* const end = text.data() + text.size();
  if (colon != std::string::npos && colon > 0) {
    options.address = text.substr(0, colon);
    if (options.address.starts_with('[') && options.address.ends_with(']'))
      options.address = options.address.substr(1, options.address.size() - 2);
    const auto [stop, failure] = std::from_chars(text.data() + colon + 1, end, options.port);
    if (failure == std::errc{} && stop == end) return {};
  }
  return Error{ErrorCode::Usage, "--listen: '" + printable(text, 60) +
                                     "' is not ADDRESS:PORT, such as 127.0.0.1:18944"};
}

std::string instrument_names() {
  std::string names;
  for (const auto& instrument : tool::instruments())
    names += (names.empty() ? "" : ", ") + instrument.name;
  return names;
}

Status read_holds(const std::vector<std::string>& texts, LinkOptions& options) {
  if (texts.size() > kToolsPerHand)
    return Error{ErrorCode::Usage, "--hold: " + std::to_string(texts.size()) +
                                       " are given, and a participant has two hands"};
  for (const auto& text : texts) {
    const auto sign = text.find('=');
    const auto device = text.substr(0, sign);
    const auto* instrument =
        sign == std::string::npos ? nullptr : tool::find_instrument(text.substr(sign + 1));
    if (device.empty() || device.size() > kMostNameBytes || instrument == nullptr)
      return Error{ErrorCode::Usage,
                   "--hold: '" + printable(text, 60) +
                       "' is not DEVICE=INSTRUMENT, a name of at most 20 bytes and one of " +
                       instrument_names()};
    for (const auto& tool : options.tools)
      if (tool.device == device)
        return Error{ErrorCode::Usage, "--hold: '" + printable(device, 60) + "' is given twice"};
    options.tools.push_back({device, instrument->shape});
  }
  return {};
}

void add_session_options(CLI::App& app, LinkOptions& options, Texts& texts) {
  app.add_option("--listen", texts.listen, "where peers connect; port 0 takes any free one")
      ->type_name("ADDR:PORT")
      ->capture_default_str();
  app.add_option("--join", options.way.join,
                 "join code or link, as the server printed it; not needed for your own server on "
                 "this machine")
      ->type_name("CODE|LINK");
  texts.server = app.add_option("--server", options.server,
                                "where the session is, or with --serve, where it will be")
                     ->type_name("HOST:PORT")
                     ->capture_default_str();
  app.add_option("--ca", options.way.ca_file,
                 "trust servers that this CA (PEM) vouches for, instead of the code's first half")
      ->type_name("FILE");
  app.add_flag("--insecure-loopback", options.way.is_insecure,
               "without TLS and codes, for tests; servers on this machine only");
  app.add_option("--wait", options.wait_s, "how long to try while no server is there yet")
      ->type_name("S")
      ->check(command_line::from_to(0, 3600))
      ->capture_default_str();
  app.add_option("--name", options.name, "how others in the session see this program")
      ->type_name("NAME");
  app.add_option("--role", texts.role,
                 "surgeon, assistant (with tools), instructor, observer (watch) [observer; with "
                 "--hold: surgeon]")
      ->check(command_line::one_of({"surgeon", "assistant", "instructor", "observer"}))
      ->type_name("ROLE");
}

void add_link_options(CLI::App& app, LinkOptions& options, Texts& texts) {
  app.add_option("--hold", texts.holds,
                 "the TRANSFORM of this device moves an instrument: " + instrument_names() +
                     "; twice: one for each hand")
      ->type_name("DEVICE=INSTRUMENT")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app.add_option("--rate", options.publish.rate_hz, "TRANSFORM and forces, at most")
      ->type_name("HZ")
      ->check(command_line::from_to(0.1, 60))
      ->capture_default_str();
  app.add_option("--surface-rate", options.publish.surface_rate_hz,
                 "POLYDATA, at most; only when the surface has changed")
      ->type_name("HZ")
      ->check(command_line::from_to(0.1, 60))
      ->capture_default_str();
  app.add_flag("--sensor", options.publish.has_sensor,
               "forces as SENSOR, too, for programs that read it; 3D Slicer does not");
  app.add_option("--origin", texts.origin,
                 "where the organ's centre is in its scan, RAS in mm; of label maps it is known "
                 "[0,0,0]")
      ->type_name("R,A,S");
}

void add_studio_options(CLI::App& app, LinkOptions& options) {
  auto& studio = options.studio;
  app.add_flag("--serve", studio.serves,
               "hold a session, with trocar-server, of each label map that comes");
  app.add_option("--label-map", options.label_map,
                 "with --serve: begin with this file, as trocar-organ import reads it")
      ->type_name("FILE");
  app.add_option("--folder", studio.folder,
                 "where label maps and organs of them are kept; without --serve none are taken "
                 "unless this is given [with --serve: .]")
      ->type_name("DIR");
  app.add_option("--nodes", studio.nodes, "of an organ's mesh")
      ->type_name("N")
      ->check(command_line::whole_from_to(100, 100'000))
      ->capture_default_str();
  app.add_option("--labels", studio.labels,
                 "which labels make the organ, such as 1:liver,2:tumour [all but 0]")
      ->type_name("LIST");
  app.add_flag("--record", studio.records,
               "with --serve: record its sessions, as trocar-server does");
}

// Says where the session will be, and where this program then finds it.
Status place_session(LinkOptions& options) {
  const auto colon = options.server.rfind(':');
  const auto address = options.server.substr(0, colon);
  const bool is_for_all = address == "0.0.0.0";
  if (colon == std::string::npos || !(is_for_all || secure::is_loopback(address)))
    return Error{ErrorCode::Usage, "--server: '" + printable(options.server, 60) +
                                       "' is not where --serve can hold a session: give "
                                       "127.0.0.1:PORT for this machine, or 0.0.0.0:PORT for any"};
  options.studio.listen = options.server;
  if (is_for_all) options.server = "127.0.0.1" + options.server.substr(colon);
  return {};
}

Status check_studio(LinkOptions& options) {
  auto& studio = options.studio;
  if (studio.serves && studio.folder.empty()) studio.folder = ".";
  if (studio.records && !studio.serves)
    return Error{ErrorCode::Usage, "--record: is of sessions held here; give --serve too"};
  if (studio.serves && !options.way.join.empty())
    return Error{ErrorCode::Usage, "--join: --serve holds a session of its own; leave one out"};
  if (!options.label_map.empty() && !studio.serves)
    return Error{ErrorCode::Usage, "--label-map: is what a session begins with; give --serve too"};
  if (studio.folder.empty()) return {};
  std::error_code error;
  if (!std::filesystem::is_directory(studio.folder, error))
    return Error{ErrorCode::Usage, "--folder: " + studio.folder.string() + " is no folder"};
  studio.is_insecure = options.way.is_insecure;
  return studio.serves ? place_session(options) : Status();
}

Status read_further(const Texts& texts, LinkOptions& options) {
  if (const auto read = read_listen(texts.listen, options); !read) return read;
  if (const auto read = read_holds(texts.holds, options); !read) return read;
  options.way.role = options.tools.empty() ? wire::Role::Observer : wire::Role::Surgeon;
  for (const auto& known : wire::kRoles)
    if (known.name == texts.role) options.way.role = known.role;
  if (!options.tools.empty() && !wire::rights_of(options.way.role).may_have_tools)
    return Error{ErrorCode::Usage, "--hold: " + wire::one_of(options.way.role) +
                                       " has no tools; use --role surgeon or assistant"};
  if (!options.way.join.empty()) {
    const auto invitation = secure::parse_invitation(options.way.join);
    if (!invitation) return Error{ErrorCode::Usage, "--join: " + invitation.error().message};
    if (texts.server->count() == 0 && !invitation->server.empty())
      options.server = invitation->server;
  }
  if (options.way.is_insecure && !(options.way.join.empty() && options.way.ca_file.empty()))
    return Error{ErrorCode::Usage,
                 "--insecure-loopback: goes with neither --join nor --ca; leave one out"};
  if (!texts.origin.empty()) {
    Vec3d ras_mm;
    if (!read_place(texts.origin, ras_mm))
      return Error{ErrorCode::Usage, "--origin: '" + printable(texts.origin, 60) +
                                         "' is not R,A,S in mm, up to 10000 each"};
    options.offset_m = Vec3d{-ras_mm.x, ras_mm.z, ras_mm.y} * 1e-3;
  }
  if (options.name.empty()) options.name = "slicer-" + std::to_string(::getpid() % 10000);
  return check_studio(options);
}

}  // namespace

Result<std::optional<LinkOptions>> parse_link_command_line(int argc, char** argv) {
  LinkOptions options;
  Texts texts;
  CLI::App app(
      "Links a session with 3D Slicer, or another program that speaks OpenIGTLink: it shows what "
      "happens there, and takes label maps and tracked instruments from it.",
      "trocar-igtl");
  app.footer(kExamples);
  app.set_version_flag("--version", std::string("trocar-igtl ") + kVersion);
  add_session_options(app, options, texts);
  add_link_options(app, options, texts);
  add_studio_options(app, options);
  app.add_option("--seconds", options.seconds, "end after so many [Ctrl-C]")
      ->type_name("N")
      ->check(command_line::from_to(0.001, 1e9));
  app.add_option("--ready-file", options.ready_file, "write the port to this file when listening")
      ->type_name("FILE");
  app.add_option("--log-level", options.log_level, "error, warn, info, debug or off")
      ->capture_default_str();
  const auto parsed = command_line::parse_command_line(app, argc, argv);
  if (!parsed) return parsed.error();
  if (!*parsed) return std::optional<LinkOptions>();
  if (const auto read = read_further(texts, options); !read) return read.error();
  return std::optional<LinkOptions>(std::move(options));
}

}  // namespace trocar::slicer
