#include "server/app/relay/options.h"

#include <CLI/CLI.hpp>

#include "common/base/printable.h"
#include "common/base/version.h"
#include "common/command_line/limits.h"
#include "server/app/config/config_file.h"
#include "server/app/config/log_options.h"
#include "server/app/config/nats_options.h"
#include "server/app/config/place.h"
#include "server/watch/bus/subjects.h"

namespace trocar::app {
namespace {

constexpr const char* kExampleFile = "deploy/trocar-relay.toml.example";
constexpr const char* kExamples = R"(
Examples:
  trocar-relay --to 127.0.0.1:7690
      for the server on this machine; prints the code for those who watch through the relay
  trocar-relay --to trocar://10.0.0.5:7690/7K3M-9QXZ-4T2B-WN8C --port 7695
      for a server elsewhere, with an observer's link as it printed it, and open to the network
  trocar-client --role observer --join CODE --server HOST:7695
  trocar-web --session HOST:7695
      who watches uses the relay as if it were the server
  trocar-relay --to 10.0.0.5:7690 --code CODE --certificate relay.crt --key relay.key --also b:7695
      one of two relays with one certificate, so that one code and one link is good for both
  trocar-relay --to 10.0.0.5:7690 --code CODE --nats nats://10.0.0.2:4222 --publish monday
      a relay that passes the session on over NATS, too
  trocar-relay --from-nats monday --nats nats://10.0.0.2:4222 --code CODE --port 7695
      one of many relays that take it from there: the server sends nothing more for them
  trocar-relay --config relay.toml --check-config
      are these options fine, and the files that they name? It asks no server and no NATS;
      deploy/trocar-relay.toml.example has all options

Exit codes: 0 ok, also when the session has ended, 2 command line, 3 bad file, 4 refused by the
server, 5 port taken, no server, or nobody who publishes.
)";
constexpr std::size_t kMostNameBytes = 29;  // a number may follow
constexpr std::size_t kMostFurther = 8;

CLI::Validator short_name() {
  return {[](std::string& text) -> std::string {
            const bool is_fine = is_printable(text) && !text.empty() &&
                                 text.size() <= kMostNameBytes && text.front() != ' ' &&
                                 text.back() != ' ';
            return is_fine ? "" : "is not a name of 1 to 29 printable bytes";
          },
          ""};
}

CLI::Validator session_name() {
  return {[](std::string& text) -> std::string {
            return bus::is_session_name(text)
                       ? ""
                       : "is not a name of 1 to 64 letters, digits, hyphens and underscores";
          },
          ""};
}

class CommandLine {
 public:
  CommandLine();

  CLI::App& app() { return app_; }
  RelayOptions& options() { return options_; }
  // Checks one option alone, as if nothing else had been given.
  Status check(const std::string& key, const std::string& text);
  Status finish();

 private:
  void add_access_options();
  void add_nats_options();
  Status read_server();
  Status read_further();

  RelayOptions options_;
  std::string to_ = "127.0.0.1:7690", code_, listen_ = "127.0.0.1:7695", metrics_;
  std::vector<std::string> further_;
  int port_ = -1;
  const CLI::Option* listening_ = nullptr;
  CLI::App app_{"Passes a session on to many who watch: to its server they are one.",
                "trocar-relay"};
};

CommandLine::CommandLine() {
  app_.footer(kExamples);
  app_.set_version_flag("--version", std::string("trocar-relay ") + kVersion + ", protocol " +
                                         std::to_string(kProtocolMajor) + "." +
                                         std::to_string(kProtocolMinor))
      ->configurable(false);
  app_.get_help_ptr()->configurable(false);
  app_.add_option("--to", to_, "the session's server, or an observer's link to it")
      ->type_name("HOST:PORT|LINK")
      ->capture_default_str();
  app_.add_option("--code", code_,
                  "an observer's join code of that server [of the link, or of a server on this "
                  "machine]")
      ->type_name("CODE");
  listening_ =
      app_.add_option("--listen", listen_, "where watchers reach it; port 0 takes any free one")
          ->type_name("ADDR:PORT")
          ->capture_default_str();
  app_.add_option("--port", port_, "the same for any network: as --listen 0.0.0.0:PORT")
      ->type_name("PORT")
      ->check(command_line::from_to(0, 65'535));
  app_.add_option("--name", options_.name, "how the server lists it [Relay and its port]")
      ->type_name("NAME")
      ->check(short_name());
  app_.add_option("--also", further_,
                  "another relay or server of this session with the same certificate, which "
                  "watchers try when this one is gone; may be given several times")
      ->type_name("HOST:PORT");
  app_.add_flag("--no-datagrams", options_.is_stream_only,
                "frames over the TCP stream alone, where lost packets hold up the picture");
  app_.add_option("--max-watchers", options_.most_watchers, "people who watch through it")
      ->type_name("N")
      ->check(command_line::from_to(1, 10'000))
      ->capture_default_str();
  app_.add_option("--metrics", metrics_,
                  "where monitoring reads /healthz, /readyz and /metrics, without TLS [nowhere]")
      ->type_name("ADDR:PORT");
  app_.add_option("--seconds", options_.seconds, "end after this many seconds [with the session]")
      ->type_name("N")
      ->check(command_line::from_to(0, 1e9));
  app_.add_option("--ready-file", options_.ready_file,
                  "write the port to this file when there is a picture to show")
      ->type_name("FILE");
  add_log_options(app_, options_.log_level, options_.log_format);
  add_config_options(app_, options_.checks_config, "options and files");
  add_nats_options();
  add_access_options();
}

void CommandLine::add_nats_options() {
  auto* nats = app_.add_option_group("NATS", "one relay for all the others");
  app::add_nats_options(*nats, options_.nats, "reach relays of this session over this NATS [no]");
  nats->add_option("--publish", options_.publish,
                   "pass the session on over NATS under this name, too [no]")
      ->type_name("SESSION")
      ->check(session_name());
  nats->add_option("--from-nats", options_.from_nats,
                   "take the session of this name from NATS instead of from its server; --code, or "
                   "the link of --to, says which code watchers need [no]")
      ->type_name("SESSION")
      ->check(session_name());
}

void CommandLine::add_access_options() {
  auto* access = app_.add_option_group("Access", "TLS and keys");
  access
      ->add_option("--state", options_.state_folder,
                   "folder of certificate and key: that of a server on this machine makes its "
                   "codes good here, too [~/.local/state/trocar]")
      ->type_name("DIR");
  auto* certificate = access
                          ->add_option("--certificate", options_.certificate_file,
                                       "use this certificate (PEM) instead of the state folder's")
                          ->type_name("FILE");
  auto* key = access->add_option("--key", options_.key_file, "the certificate's key (PEM)")
                  ->type_name("FILE");
  certificate->needs(key);
  key->needs(certificate);
}

Status CommandLine::check(const std::string& key, const std::string& text) {
  return check_option(app_, key, text, [this] { return finish(); });
}

Status CommandLine::read_server() {
  std::string server = to_;
  if (to_.starts_with("trocar://")) {
    const auto link = secure::parse_invitation(to_);
    if (!link) return Error{ErrorCode::Usage, "--to: " + link.error().message};
    server = link->server;
    options_.code = link->code;
  }
  if (!code_.empty()) {
    const auto code = secure::parse_join_code(code_);
    if (!code) return Error{ErrorCode::Usage, "--code: " + code.error().message};
    options_.code = *code;
  }
  options_.server.name = server;
  return parse_place("--to", "127.0.0.1:7690", server, options_.server.host, options_.server.port);
}

Status CommandLine::read_further() {
  options_.further_addresses.clear();
  if (further_.size() > kMostFurther)
    return Error{ErrorCode::Usage, "--also: " + std::to_string(further_.size()) +
                                       " addresses, at most " + std::to_string(kMostFurther)};
  for (const auto& text : further_) {
    std::string host;
    std::uint16_t port = 0;
    if (auto s = parse_place("--also", "10.0.0.6:7695", text, host, port); !s) return s;
    options_.further_addresses.push_back(text);
  }
  return {};
}

Status CommandLine::finish() {
  if (auto s = read_server(); !s) return s;
  if (auto s = read_further(); !s) return s;
  if (auto s = parse_place("--listen", "127.0.0.1:7695", listen_, options_.address, options_.port);
      !s)
    return s;
  if (port_ >= 0) {
    if (listening_->count() > 0)
      return Error{ErrorCode::Usage, "--port: --listen says the port already, leave one out"};
    options_.address = "0.0.0.0";
    options_.port = static_cast<std::uint16_t>(port_);
  }
  if (metrics_.empty()) return {};
  return parse_place("--metrics", "127.0.0.1:7696", metrics_, options_.metrics_address,
                     options_.metrics_port);
}

// Options that need each other.
Status check_together(const RelayOptions& options) {
  const auto &publish = options.publish, &from = options.from_nats;
  if (!publish.empty() && !from.empty())
    return Error{ErrorCode::Usage, "--publish: a session --from-nats is published already"};
  if (options.nats.url.empty()) {
    if (!publish.empty()) return Error{ErrorCode::Usage, "--publish: needs --nats URL"};
    if (!from.empty()) return Error{ErrorCode::Usage, "--from-nats: needs --nats URL"};
    return {};
  }
  if (publish.empty() && from.empty())
    return Error{ErrorCode::Usage, "--nats: needs --publish or --from-nats"};
  if (!from.empty() && !options.code)
    return Error{ErrorCode::Usage,
                 "--code: --from-nats needs an observer's join code of the session, for watchers"};
  return bus::check_place(options.nats);
}

}  // namespace

Result<std::optional<RelayOptions>> parse_relay_command_line(int argc, char** argv) {
  auto read = read_command_line<CommandLine>(argc, argv, kExampleFile);
  if (!read || !*read) return read;
  if (const auto fine = check_together(**read); !fine)
    return Error{ErrorCode::Usage, (*read)->origins.placed(fine.error().message)};
  return read;
}

}  // namespace trocar::app
