#include "server/app/hall/options.h"

#include <CLI/CLI.hpp>
#include <charconv>

#include "common/base/version.h"
#include "common/command_line/command_line.h"
#include "server/app/config/log_options.h"
#include "server/app/config/nats_options.h"

namespace trocar::app {
namespace {

constexpr std::string_view kHttps = "https://";

constexpr const char* kHallExamples = R"(
Examples:
  trocar-hall --config hall.toml
      sessions on request, as that file allows; deploy/trocar-hall.toml.example explains every key
  trocar-hall --config hall.toml --check-config
      would a start with this file succeed?
  trocar-hall start find-the-lump --key hall.key
      starts a session and prints its address and join codes
  trocar-hall list --at https://theatre:7694 --certificate hall.crt --key hall.key
      a hall on another machine, with tls = true in its file; hall.crt lies in its folder of state
  trocar-hall list --key hall.key
      the sessions that run, with their codes; without the key also, but then without codes
  trocar-hall end find-the-lump-1 --key hall.key
      ends it, and returns when its recording is closed
  trocar-hall --config hall.toml --nats nats://10.0.0.2:4222
      a hall that others find over NATS; all of them need the same key
  trocar-hall start find-the-lump --nats nats://10.0.0.2:4222 --key hall.key
      starts it on the hall with the most room
  trocar-hall list --nats nats://10.0.0.2:4222
      the sessions of all halls

The key is a file that the hall makes at its first start. Ctrl-C, SIGTERM or a closed terminal ends the
hall and all its sessions in order; under nohup it outlives its terminal. When it is killed, its sessions
go on, and the next hall finds them again.
Exit codes: 0 ok, also after Ctrl-C, 2 command line, 3 bad file, 4 the hall says no, 5 port taken or no
hall there.
)";

void add_command_options(CLI::App& command, HallOptions& options) {
  command.add_option("--at", options.at, "where the hall is; https://HOST:PORT: over TLS")
      ->type_name("HOST:PORT")
      ->capture_default_str();
  command
      .add_option("--certificate", options.certificate_file,
                  "the certificate that the hall has to show (PEM) [one that this machine trusts, "
                  "of this host]")
      ->type_name("FILE");
  command.add_flag("--without-tls", options.sends_openly,
                   "send the key to another machine where others can read it on its way");
  add_nats_options(command, options.nats, "ask all halls of this NATS instead");
  command.add_option("--key", options.key_file, "file with the hall's key")->type_name("FILE");
}

Status parse_at(HallOptions& options) {
  std::string text = options.at;
  options.has_tls = text.starts_with(kHttps);
  if (options.has_tls) text.erase(0, kHttps.size());
  const auto colon = text.rfind(':');
  const Error bad{ErrorCode::Usage,
                  "--at: '" + options.at +
                      "' is neither HOST:PORT, such as 127.0.0.1:7694, nor https://HOST:PORT"};
  if (colon == std::string::npos || colon == 0) return bad;
  options.host = text.substr(0, colon);
  if (options.host.starts_with('[') && options.host.ends_with(']'))
    options.host = options.host.substr(1, options.host.size() - 2);
  const char* end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data() + colon + 1, end, options.port);
  if (options.host.empty() || parsed.ec != std::errc{} || parsed.ptr != end || options.port == 0)
    return bad;
  if (!options.certificate_file.empty() && !options.has_tls)
    return Error{ErrorCode::Usage,
                 "--certificate: is for a hall with TLS, give --at https://HOST:PORT"};
  return {};
}

}  // namespace

Result<std::optional<HallOptions>> parse_hall_command_line(int argc, char** argv) {
  HallOptions options;
  CLI::App app{"Holds many sessions on one machine: it starts and ends them on request.",
               "trocar-hall"};
  app.footer(kHallExamples);
  app.set_version_flag("--version", std::string("trocar-hall ") + kVersion);
  auto* config = app.add_option("--config", options.config_file,
                                "be a hall, with the configuration in this file (TOML)")
                     ->type_name("FILE");
  app.add_flag("--check-config", options.checks_config,
               "check the file as a start would, and exit with 0 or 2")
      ->needs(config);
  add_nats_options(app, options.nats,
                   "tell others over this NATS what runs here, and take their requests [no]");
  app.add_option("--ready-file", options.ready_file, "write the port to this file when listening")
      ->type_name("FILE");
  add_log_options(app, options.log_level, options.log_format);
  app.require_subcommand(0, 1);
  auto* list = app.add_subcommand("list", "says which sessions run");
  auto* start = app.add_subcommand("start", "starts a session, and says where it is");
  auto* end = app.add_subcommand("end", "ends a session");
  for (auto* command : {list, start, end}) add_command_options(*command, options);
  // The names of these are what errors say.
  start->add_option("LESSON", options.what, "lesson or organ, as the hall's configuration names it")
      ->required()
      ->type_name("");
  start->add_option("--name", options.name, "name of the session [the lesson's, with a number]")
      ->type_name("NAME");
  end->add_option("NAME", options.what, "name of the session")->required()->type_name("");
  for (auto* command : {list, start})
    command->add_flag("--json", options.is_json, "write JSON, for scripts");
  const auto parsed = command_line::parse_command_line(app, argc, argv);
  if (!parsed) return parsed.error();
  if (!*parsed) return std::optional<HallOptions>();
  if (!options.nats.url.empty())
    if (const auto place = bus::check_place(options.nats); !place) return place.error();
  options.command = list->parsed()    ? HallCommand::List
                    : start->parsed() ? HallCommand::Start
                    : end->parsed()   ? HallCommand::End
                                      : HallCommand::Serve;
  if (options.command == HallCommand::Serve) {
    if (options.config_file.empty())
      return Error{ErrorCode::Usage,
                   "--config: is missing, name a file, or give one of list, start and end"};
    return std::optional(std::move(options));
  }
  if (const auto placed = parse_at(options); !placed) return placed.error();
  if (options.key_file.empty() && options.command != HallCommand::List)
    return Error{ErrorCode::Usage, "--key: is missing, name the file of the hall's key"};
  return std::optional(std::move(options));
}

}  // namespace trocar::app
