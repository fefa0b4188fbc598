#include "client/crtk/options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cstdlib>

#include "common/base/printable.h"
#include "common/base/version.h"
#include "common/command_line/command_line.h"
#include "common/command_line/limits.h"
#include "common/secure/join_code.h"
#include "common/tool/instrument.h"
#include "common/tool/port.h"
#include "common/wire/role.h"

namespace trocar::crtk {
namespace {

constexpr const char* kExamples = R"(
Examples:
  trocar-crtk
      arms PSM1, PSM2 and ECM in your own server's session, for programs of this machine
  ros2 topic pub --once /PSM1/state_command crtk_msgs/msg/StringStamped '{string: home}'
      then enables and homes one; from now on it follows /PSM1/servo_cp
  trocar-crtk --arm PSM1 --tool scissors --port 60,110,140
      one arm that cuts, through a port there
  trocar-crtk --join trocar://192.168.1.20:7690/7K3M-9QXZ-4T2B-WN8C --interface eth0
      a session on another machine, for ROS 2 in the network of eth0

DDS asks nobody who he is: whoever reaches the interface moves the arms. Lengths on the bus are in
m, angles in rad, forces in N, poses in the arm's frame NAME_base: origin at its port, +z out of
the body. Ends with the session, with --seconds or Ctrl-C. Exit codes: 0 ok, 2 command line, 3 bad
file, 4 refused by the server, 5 server or network interface not reached, or lost.
)";

constexpr double kMostPort_m = 1.7;  // the server ends a session for tools beyond 2 m

struct Usual {
  const char* name;
  const char* tool;
  Vec3d port_m;
};
constexpr Usual kUsual[] = {{"PSM1", "grasper", {0.08, 0.10, 0.14}},
                            {"PSM2", "grasper", {-0.08, 0.10, 0.14}},
                            {"ECM", "endoscope-30", {0, 0.12, 0.16}}};

struct GivenTexts {
  std::vector<std::string> arms, tools, ports;
  std::string role = "surgeon";
};

bool is_arm_name(const std::string& name) {
  return name == "ECM" ||
         (name.size() == 4 && name.starts_with("PSM") && name[3] >= '1' && name[3] <= '9');
}

Error usage(std::string text) {
  return {ErrorCode::Usage, std::move(text)};
}

Result<ArmOptions> arm_of(const std::string& name, const std::string& tool_name,
                          const std::optional<Vec3d>& port_m) {
  const auto usual = std::ranges::find(kUsual, name, &Usual::name);
  const bool is_known = usual != std::end(kUsual);
  if (!port_m && !is_known) return usage("--port: " + name + " has no usual port; give one");
  ArmOptions arm;
  arm.settings.name = name;
  arm.settings.port_m = port_m ? *port_m : usual->port_m;
  if (!(length(arm.settings.port_m) <= kMostPort_m))
    return usage("--port: that of " + name + " is more than 1700 mm from the organ's middle");
  const std::string wanted = !tool_name.empty() ? tool_name : is_known ? usual->tool : "grasper";
  const auto* instrument = tool::find_instrument(wanted);
  if (instrument == nullptr) {
    std::string known;
    for (const auto& one : tool::instruments()) known += (known.empty() ? "" : ", ") + one.name;
    return usage("--tool: " + printable(wanted, 40) + " is none of " + known);
  }
  arm.shape = instrument->shape;
  arm.settings.grip_verb = instrument->grip_verb();
  const bool is_straight = name == "ECM";
  arm.settings.kinematics.has_wrist = arm.settings.has_jaw = !is_straight;
  // Behind its wrist the shaft goes another way.
  if (!is_straight) arm.shape.length_m = std::min(arm.shape.length_m, kWristToTip_m);
  return arm;
}

Status set_arms(const GivenTexts& given, std::vector<ArmOptions>& arms) {
  auto names = given.arms;
  if (names.empty())
    for (const auto& usual : kUsual) names.emplace_back(usual.name);
  const auto fits = [&](const auto& texts) {
    return texts.empty() || texts.size() == names.size();
  };
  if (!fits(given.tools) || !fits(given.ports))
    return usage("--tool, --port: give none, or one for each of " + std::to_string(names.size()) +
                 " arms, in their order");
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (!is_arm_name(names[i]))
      return usage("--arm: '" + printable(names[i], 20) + "' is none of PSM1 to PSM9, ECM");
    if (std::find(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(i), names[i]) !=
        names.begin() + static_cast<std::ptrdiff_t>(i))
      return usage("--arm: " + names[i] + " is given twice");
    std::optional<Vec3d> port_m;
    if (!given.ports.empty()) {
      const auto parsed = tool::parse_port(given.ports[i]);
      if (!parsed) return parsed.error();
      port_m = *parsed;
    }
    auto arm = arm_of(names[i], given.tools.empty() ? "" : given.tools[i], port_m);
    if (!arm) return arm.error();
    arms.push_back(std::move(*arm));
  }
  return {};
}

Result<std::uint32_t> domain_of_environment() {
  const char* const text = std::getenv("ROS_DOMAIN_ID");
  if (text == nullptr || *text == '\0') return std::uint32_t{0};
  std::uint32_t domain = 0;
  const char* const end = text + std::string_view(text).size();
  const auto [stop, failure] = std::from_chars(text, end, domain);
  if (failure == std::errc{} && stop == end && domain <= Bus::kMostDomain) return domain;
  return usage("ROS_DOMAIN_ID: '" + printable(text, 20) + "' is not a whole number from 0 to " +
               std::to_string(Bus::kMostDomain));
}

void add_options(CLI::App& app, CrtkOptions& options, GivenTexts& given) {
  app.add_option("--arm", given.arms, "PSM1 to PSM9 or ECM, once for each [PSM1 PSM2 ECM]")
      ->type_name("NAME");
  app.add_option("--tool", given.tools,
                 "instrument of each arm, as trocar-client has them [grasper, ECM endoscope-30]")
      ->type_name("NAME");
  app.add_option("--port", given.ports,
                 "remote centre of each arm, mm from the organ's middle, y up, z to the front "
                 "[PSM1 80,100,140 PSM2 -80,100,140 ECM 0,120,160]")
      ->type_name("X,Y,Z");
  app.add_option("--domain", options.bus.domain, "domain of DDS [ROS_DOMAIN_ID, or 0]")
      ->type_name("N")
      ->check(command_line::whole_from_to(0, Bus::kMostDomain));
  app.add_option("--interface", options.bus.interface,
                 "network interface whose machines may move the arms [this machine alone]")
      ->type_name("NAME")
      ->check(CLI::Validator(
          [](const std::string& name) {
            const bool is_name =
                !name.empty() && name.size() <= 15 && std::ranges::all_of(name, [](char c) {
                  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_' ||
                         c == '.';
                });
            return is_name ? "" : printable(name, 20) + " is no name such as eth0";
          },
          ""));
  app.add_option("--seconds", options.seconds, "leave after this many seconds")
      ->type_name("N")
      ->check(command_line::from_to(0, 1e9));
}

void add_session_options(CLI::App& app, CrtkOptions& options, GivenTexts& given) {
  app.add_option("--join", options.way_in.join, "join code or link, as the server printed it")
      ->type_name("CODE|LINK");
  app.add_option("--ca", options.way_in.ca_file, "certificate of who vouches for the server (PEM)")
      ->type_name("FILE");
  app.add_flag("--insecure-loopback", options.way_in.is_insecure,
               "without TLS, for a server on this machine that was started so");
  app.add_option("--role", given.role, "of the arms")
      ->check(command_line::one_of({"surgeon", "assistant"}))
      ->type_name("ROLE")
      ->capture_default_str();
  app.add_option("--wait", options.wait_s, "how long to try while no server is there yet")
      ->type_name("S")
      ->check(command_line::from_to(0, 3600))
      ->capture_default_str();
  app.add_option("--log-level", options.log_level, "error, warn, info or debug")
      ->type_name("LEVEL")
      ->capture_default_str();
}

}  // namespace

Result<std::optional<CrtkOptions>> parse_crtk_command_line(int argc, char** argv) {
  CrtkOptions options;
  GivenTexts given;
  CLI::App app("Lets robots' programs move instruments of a session: CRTK over DDS, as in ROS 2.",
               "trocar-crtk");
  app.footer(kExamples);
  app.set_version_flag("--version", std::string("trocar-crtk ") + kVersion);
  auto* server = app.add_option("--server", options.server, "HOST[:PORT] of the session")
                     ->type_name("HOST[:PORT]")
                     ->capture_default_str();
  add_session_options(app, options, given);
  const auto domain = domain_of_environment();
  if (domain) options.bus.domain = *domain;
  add_options(app, options, given);
  const auto parsed = command_line::parse_command_line(app, argc, argv);
  if (!parsed) return parsed.error();
  if (!*parsed) return std::optional<CrtkOptions>();
  options.way_in.role = given.role == "assistant" ? wire::Role::Assistant : wire::Role::Surgeon;
  if (!domain && app.get_option("--domain")->count() == 0) return domain.error();
  if (!options.way_in.join.empty()) {
    const auto invitation = secure::parse_invitation(options.way_in.join);
    if (!invitation) return usage("--join: " + invitation.error().message);
    if (server->count() == 0 && !invitation->server.empty()) options.server = invitation->server;
  }
  if (const auto set = set_arms(given, options.arms); !set) return set.error();
  return std::optional<CrtkOptions>(std::move(options));
}

}  // namespace trocar::crtk
