// trocar-doctor: says whether this machine can take part in a session, and what to do if not.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <optional>

#include "client/doctor/advice.h"
#include "client/doctor/machine.h"
#include "client/doctor/visitor.h"
#include "common/base/log.h"
#include "common/base/program.h"
#include "common/base/stdout_check.h"
#include "common/base/version.h"
#include "common/command_line/command_line.h"
#include "common/command_line/limits.h"
#include "common/discovery/finder.h"
#include "common/secure/join_code.h"
#include "common/secure/link_file.h"

namespace trocar::doctor {
namespace {

constexpr const char* kProgram = "trocar-doctor";
constexpr const char* kOwnServer = "127.0.0.1:7690";
constexpr std::uint16_t kOwnPort = 7690;
constexpr double kLookSeconds = 2, kDrawSeconds = 1;
constexpr const char* kExamples = R"(
Examples:
  trocar-doctor --join trocar://192.168.1.20:7690/7K3M-9QXZ-4T2B-WN8C
      tries the session of that link, and this machine
  trocar-doctor 192.168.1.20:7690
      finds out whether the server can be reached
  trocar-doctor
      tries this machine, and your own server on it or the first session that announces itself
  trocar-doctor --json --join CODE 192.168.1.20 > doctor.json
      the same for administrators and scripts

It joins as an observer, changes nothing, and leaves.
Exit codes: 0 good, 1 usable with limits, 2 you cannot take part, or the command line is wrong.
)";

struct DoctorOptions {
  VisitOptions visit;
  bool is_json = false;
};

// No value: --help or --version was asked for and printed.
Result<std::optional<DoctorOptions>> parse(int argc, char** argv) {
  DoctorOptions options;
  auto& visit = options.visit;
  CLI::App app("Says whether this machine can take part in a session, and what to do if not.",
               kProgram);
  app.footer(kExamples);
  app.set_version_flag("--version", std::string("trocar-doctor ") + kVersion);
  app.add_option("SERVER", visit.server, "HOST[:PORT], if no link says it");
  app.add_option("--join", visit.join, "join code or link, as the server printed it")
      ->type_name("CODE|LINK");
  app.add_option("--ca", visit.ca_file, "certificate of who vouches for the server (PEM)")
      ->type_name("FILE");
  app.add_flag("--insecure-loopback", visit.is_insecure,
               "without TLS, for a server on this machine that was started so");
  app.add_option("--seconds", visit.seconds, "how long the session is measured")
      ->type_name("S")
      ->check(command_line::from_to(1, 600))
      ->capture_default_str();
  app.add_option("--wait", visit.wait_s, "how long to wait for an answer")
      ->type_name("S")
      ->check(command_line::from_to(0.5, 600))
      ->capture_default_str();
  app.add_flag("--json", options.is_json, "write figures and words as JSON");
  const auto parsed = command_line::parse_command_line(app, argc, argv);
  if (!parsed) return parsed.error();
  if (!*parsed) return std::optional<DoctorOptions>();
  if (!visit.join.empty()) {
    const auto invitation = secure::parse_invitation(visit.join);
    if (!invitation) return Error{ErrorCode::Usage, "--join: " + invitation.error().message};
    if (visit.server.empty()) visit.server = invitation->server;
  }
  return std::optional<DoctorOptions>(std::move(options));
}

// Finds a session where none was named.
void choose_server(VisitOptions& visit, Measurements& measured) {
  if (!visit.server.empty()) return;
  if (visit.is_insecure || secure::read_link_file(kOwnPort, "observer")) {
    visit.server = kOwnServer;
    return;
  }
  const auto found = discovery::find_sessions(kLookSeconds);
  if (found)
    for (const auto& session : *found)
      measured.sessions.push_back(session.address + ":" + std::to_string(session.port));
  if (!measured.sessions.empty())
    visit.server = measured.sessions.front();
  else
    measured.visit.problem =
        found ? "no session announces itself here" : "no Avahi daemon runs here to find one";
}

int run(int argc, char** argv) {
  auto options = parse(argc, argv);
  if (!options) return report(kProgram, options.error());
  if (!*options) return static_cast<int>(ExitCode::Ok);
  if (const auto set = log::configure(kProgram, "error"); !set)
    return report(kProgram, set.error());
  Measurements measured;
  choose_server((*options)->visit, measured);
  Visited visited;
  if (!(*options)->visit.server.empty()) {
    auto visit = visit_session((*options)->visit);
    if (!visit) return report(kProgram, visit.error());
    visited = std::move(*visit);
    measured.visit = visited.figures;
  }
  measured.graphics = measure_graphics(visited, kDrawSeconds);
  measured.devices = find_devices();
  std::error_code error;
  measured.folder = std::filesystem::current_path(error).string();
  measured.free_bytes = free_bytes_in(measured.folder);
  const auto advice = judge(measured);
  const auto text =
      (*options)->is_json ? trocar::to_text(to_json(advice, measured)) : to_text(advice);
  std::fputs(text.c_str(), stdout);
  return static_cast<int>(advice.grade);
}

}  // namespace
}  // namespace trocar::doctor

int main(int argc, char** argv) {
  trocar::begin_program(trocar::doctor::kProgram);
  return trocar::finish_output(trocar::doctor::kProgram, trocar::doctor::run(argc, argv));
}
