#include "server/app/web/options.h"

#include <CLI/CLI.hpp>
#include <charconv>

#include "common/base/version.h"
#include "common/command_line/limits.h"
#include "common/secure/loopback.h"
#include "server/app/config/config_file.h"
#include "server/app/config/log_options.h"

namespace trocar::app {
namespace {

constexpr const char* kExampleFile = "deploy/trocar-web.toml.example";
constexpr const char* kExamples = R"(
Examples:
  trocar-web --insecure-loopback
      the page for your own server on this machine; prints links for a browser here
  trocar-web --listen 0.0.0.0:7691 --certificate page.crt --key page.key
      for everybody on the network, with a certificate that their browsers trust
  trocar-web --session 10.0.0.5:7690 --session 10.0.0.6:7690
      two sessions; a link says which: https://HOST:7691/#join=CODE&session=10.0.0.6:7690
  trocar-web --recordings lessons
      also the recordings in that folder, to who has the link that is printed
  trocar-web --recordings lessons --new-recordings-key
      the links to recordings that were given away before are good no more
  trocar-web --config web.toml --check-config
      would a start with these options succeed? deploy/trocar-web.toml.example has all of them

Who watches needs a join code of the session, as trocar-server prints them. In the link it stands
behind the #, which no browser sends to a server.
Exit codes: 0 ok, also after Ctrl-C, 2 command line, 3 bad file, 5 port taken or page missing.
)";

Error bad_place(const char* option, const std::string& text) {
  return {ErrorCode::Usage,
          std::string(option) + ": '" + text + "' is not HOST:PORT, such as 127.0.0.1:7690"};
}

Status parse_place(const char* option, const std::string& text, std::string& host,
                   std::uint16_t& port) {
  const auto colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) return bad_place(option, text);
  host = text.substr(0, colon);
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  const char* end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data() + colon + 1, end, port);
  if (host.empty() || parsed.ec != std::errc{} || parsed.ptr != end) return bad_place(option, text);
  return {};
}

class CommandLine {
 public:
  CommandLine();

  CLI::App& app() { return app_; }
  WebOptions& options() { return options_; }
  // Checks one option alone, as if nothing else had been given.
  Status check(const std::string& key, const std::string& text);
  Status finish();

 private:
  void add_practice_options();
  void add_access_options();
  void add_limit_options();

  WebOptions options_;
  std::string listen_ = "127.0.0.1:7691", metrics_, hall_ = "127.0.0.1:7694";
  const CLI::Option* session_ = nullptr;
  std::vector<std::string> sessions_{"127.0.0.1:7690"};
  CLI::App app_{"Serves the page on which people watch sessions and recordings in a browser.",
                "trocar-web"};
};

CommandLine::CommandLine() {
  app_.footer(kExamples);
  app_.set_version_flag("--version", std::string("trocar-web ") + kVersion + ", protocol " +
                                         std::to_string(kProtocolMajor) + "." +
                                         std::to_string(kProtocolMinor))
      ->configurable(false);
  app_.get_help_ptr()->configurable(false);
  session_ = app_.add_option("--session", sessions_,
                             "a session that may be watched; the first one if a link "
                             "names none; may be given several times")
                 ->type_name("HOST:PORT")
                 ->capture_default_str();
  app_.add_option("--listen", listen_, "where browsers reach it; port 0 takes any free one")
      ->type_name("ADDR:PORT")
      ->capture_default_str();
  app_.add_option("--public-name", options_.public_name,
                  "how links name this machine, if not by the address")
      ->type_name("HOST[:PORT]");
  app_.add_flag("--qr", options_.draws_codes,
                "print the links as QR codes, too, as is done on a terminal where other machines "
                "reach the page");
  app_.add_option("--recordings", options_.recordings_folder,
                  "folder whose recordings may be watched, those named by letters, digits, ., _ "
                  "and - [none]")
      ->type_name("DIR");
  app_.add_option("--page", options_.page_folder, "folder of the page's files [beside the program]")
      ->type_name("DIR");
  app_.add_option("--metrics", metrics_,
                  "where monitoring reads /healthz, /readyz and /metrics, without TLS [nowhere]")
      ->type_name("ADDR:PORT");
  app_.add_option("--seconds", options_.seconds, "end after this many seconds [Ctrl-C]")
      ->type_name("N")
      ->check(command_line::from_to(0, 1e9));
  app_.add_option("--ready-file", options_.ready_file, "write the port to this file when listening")
      ->type_name("FILE");
  add_log_options(app_, options_.log_level, options_.log_format);
  add_config_options(app_, options_.checks_config, "options and files");
  add_practice_options();
  add_access_options();
  add_limit_options();
}

void CommandLine::add_access_options() {
  auto* access = app_.add_option_group("Access", "TLS and keys");
  access
      ->add_option("--state", options_.state_folder,
                   "folder of certificate and keys [~/.local/state/trocar]")
      ->type_name("DIR");
  auto* certificate = access
                          ->add_option("--certificate", options_.certificate_file,
                                       "use this certificate (PEM) instead of one of its own, "
                                       "which browsers warn of")
                          ->type_name("FILE");
  auto* key = access->add_option("--key", options_.key_file, "the certificate's key (PEM)")
                  ->type_name("FILE");
  certificate->needs(key);
  key->needs(certificate);
  access->add_flag("--insecure-loopback", options_.is_insecure,
                   "without TLS towards browsers; 127.0.0.1 and [::1] only");
  access
      ->add_flag("--new-recordings-key", options_.makes_new_key,
                 "links to recordings from before are good no more")
      ->configurable(false);
}

void CommandLine::add_practice_options() {
  auto& practice = options_.practice;
  auto* group = app_.add_option_group("Practice", "a session for each visitor, of trocar-hall");
  group
      ->add_option("--practice", practice.offer,
                   "what visitors practise alone, by a name of the hall's offers [nothing]")
      ->type_name("OFFER");
  group->add_option("--hall", hall_, "the hall, on this machine and without TLS")
      ->type_name("HOST:PORT")
      ->capture_default_str();
  group->add_option("--hall-key", practice.key_file, "file with the hall's key")
      ->type_name("FILE")
      ->capture_default_str();
  group->add_option("--practice-minutes", practice.minutes, "how long one may practise")
      ->type_name("N")
      ->check(command_line::whole_from_to(1, 1440))
      ->capture_default_str();
  group
      ->add_option("--practice-idle", practice.idle_s,
                   "seconds without a deed after which a session ends")
      ->type_name("N")
      ->check(command_line::whole_from_to(10, 86'400))
      ->capture_default_str();
}

void CommandLine::add_limit_options() {
  auto* limits = app_.add_option_group("Limits", "how much strangers may take");
  limits->add_option("--max-connections", options_.most_connections, "connections of browsers")
      ->type_name("N")
      ->check(command_line::whole_from_to(4, 10'000))
      ->capture_default_str();
  limits
      ->add_option("--max-connections-per-address", options_.most_per_address,
                   "of these from one address")
      ->type_name("N")
      ->check(command_line::whole_from_to(4, 10'000))
      ->capture_default_str();
  limits
      ->add_option("--check-limit", options_.check_limit_s,
                   "seconds after which the check of a recording is given up")
      ->type_name("N")
      ->check(command_line::whole_from_to(1, 86'400))
      ->capture_default_str();
}

Status CommandLine::check(const std::string& key, const std::string& text) {
  // Whether TLS may be left out depends on another option.
  const bool is_alone = key != "insecure-loopback";
  return check_option(app_, key, text, [&] { return is_alone ? finish() : Status(); });
}

Status CommandLine::finish() {
  if (auto s = parse_place("--listen", listen_, options_.address, options_.port); !s) return s;
  if (!metrics_.empty())
    if (auto s =
            parse_place("--metrics", metrics_, options_.metrics_address, options_.metrics_port);
        !s)
      return s;
  if (options_.makes_new_key && options_.recordings_folder.empty())
    return Error{ErrorCode::Usage, "--new-recordings-key: needs --recordings, whose links it ends"};
  auto& practice = options_.practice;
  if (auto s = parse_place("--hall", hall_, practice.hall_host, practice.hall_port); !s) return s;
  if (!practice.offer.empty() && !secure::is_loopback(practice.hall_host))
    return Error{ErrorCode::Usage, "--hall: " + practice.hall_host +
                                       " is another machine, on the way to which others could read "
                                       "the key: run trocar-web beside the hall"};
  // Who only practises needs no other session.
  const bool has_sessions = practice.offer.empty() || session_->count() > 0;
  options_.sessions.clear();
  for (const auto& text : sessions_) {
    follow::SessionAddress session;
    session.name = text;
    if (auto s = parse_place("--session", text, session.host, session.port); !s) return s;
    if (has_sessions) options_.sessions.push_back(std::move(session));
  }
  if (options_.is_insecure && !secure::is_loopback(options_.address))
    return Error{ErrorCode::Usage, "--insecure-loopback: " + options_.address +
                                       " can be reached from other machines: use it with "
                                       "127.0.0.1 or [::1], or leave it out"};
  return {};
}

}  // namespace

Result<std::optional<WebOptions>> parse_web_command_line(int argc, char** argv) {
  return read_command_line<CommandLine>(argc, argv, kExampleFile);
}

}  // namespace trocar::app
