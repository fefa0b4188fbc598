#include "server/app/server/options.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "common/base/printable.h"
#include "common/base/version.h"
#include "common/base/workers.h"
#include "common/command_line/limits.h"
#include "common/discovery/notice.h"
#include "server/app/config/config_file.h"
#include "server/app/config/log_options.h"
#include "server/app/config/place.h"
#include "server/app/server/journal_sink.h"
#include "server/tissue/step/simulation.h"
#include "server/tissue/thread/rules_toml.h"

namespace trocar::app {
namespace {

constexpr double kMostPace = 20;
constexpr const char* kExampleFile = "deploy/trocar-server.toml.example";
constexpr const char* kExamples = R"(
Examples:
  trocar-server
      the built-in liver at 127.0.0.1:7690, for programs on this machine
  trocar-server --lesson find-the-lump
      a lesson with goals and points; trocar-journal assess reads its recording
  trocar-server --lesson find-the-lump --listen 0.0.0.0:7690 --browser
      the same for everybody on the network: a link and a QR code for each role, for any browser
  trocar-server --organ lattice --listen 0.0.0.0:7690
      a block of springs, for everybody on the network who has one of the printed join codes
  trocar-server --listen 0.0.0.0:7690 --revoke observer
      nobody joins the server at that port with an observer's code any more; with --put-out those
      who came with it have to go, and with --new-code observer there is another one
  trocar-server --organ liver.organ --sweeps 6 --budget 0.6
      up to six passes, as long as a tick takes no more than 0.6 ms
  trocar-server --resume lesson.mcap --journal lesson-2.mcap
      after a crash: goes on where that recording ends, with all cuts; people come back
  trocar-server --listen 0.0.0.0:7690 --announce "Lesson one"
      trocar-client --list on another machine shows it under this name
  trocar-server --config lesson.toml --check-config
      would a start with these options succeed? deploy/trocar-server.toml.example has all of them
  trocar-server --seconds 20 --summary out/summary.json --journal out/session.mcap
      20 simulated seconds, then the replicas are compared, and the figures written

Ctrl-C or SIGTERM: everybody is asked for the CRC of what they show, told goodbye, and the journal
is closed. Exit codes: 0 ok, 2 command line, 3 bad file, 5 port taken or processor too old.
)";

std::string version_text() {
  return std::string("trocar-server ") + kVersion + ", sim_version " + std::to_string(kSimVersion) +
         ", protocol " + std::to_string(kProtocolMajor) + "." + std::to_string(kProtocolMinor);
}

CLI::Validator printable_name() {
  return {[](std::string& text) -> std::string {
            if (is_printable(text) && !text.empty() && text.size() <= discovery::kMostNameBytes)
              return {};
            return fmt::format("is not a name of 1 to {} printable bytes",
                               discovery::kMostNameBytes);
          },
          ""};
}

void add_access_options(CLI::App& app, AccessOptions& options) {
  auto* access = app.add_option_group("Access", "who may join");
  access->add_option("--code-hours", options.code_hours, "how long the join codes are good")
      ->type_name("H")
      ->check(command_line::from_to(0.01, 8760))
      ->capture_default_str();
  access->add_option("--code-uses", options.code_uses, "how often each may be used, 0: any number")
      ->type_name("N")
      ->check(command_line::whole_from_to(0, 1'000'000))
      ->capture_default_str();
  access->add_flag("--keep-codes", options.keeps_codes,
                   "codes stay good after the end, for the next start with this option");
  auto* revoke = access
                     ->add_option("--revoke", options.revoke,
                                  "revoke a code, or all of a role, of the server that runs at "
                                  "--listen, and exit")
                     ->type_name("CODE|ROLE");
  access
      ->add_flag("--put-out", options.puts_out,
                 "with --revoke: who came with the code has to go, too")
      ->needs(revoke);
  access
      ->add_option("--new-code", options.new_code,
                   "make one more code of a role for the server that runs at --listen, and exit")
      ->type_name("ROLE")
      ->check(command_line::one_of({"surgeon", "assistant", "instructor", "observer"}));
  access
      ->add_option("--return-seconds", options.return_seconds,
                   "how long somebody's seat is kept when the connection breaks, 0: not")
      ->type_name("N")
      ->check(command_line::whole_from_to(0, 3600))
      ->capture_default_str();
  access
      ->add_option("--audit", options.audit_file,
                   "log of joins, refusals and marks [audit.jsonl in the state folder]")
      ->type_name("FILE");
  access
      ->add_option("--state", options.state_folder,
                   "folder of certificate, key and codes [~/.local/state/trocar]")
      ->type_name("DIR");
  auto* certificate = access
                          ->add_option("--certificate", options.certificate_file,
                                       "use this certificate (PEM) instead of the state folder's")
                          ->type_name("FILE");
  auto* key = access->add_option("--key", options.key_file, "the certificate's key (PEM)")
                  ->type_name("FILE");
  certificate->needs(key);
  key->needs(certificate);
  access->add_flag("--insecure-loopback", options.is_insecure,
                   "without TLS and codes, for tests; 127.0.0.1 and [::1] only");
}

void add_limit_options(CLI::App& app, LimitOptions& options) {
  auto* limits = app.add_option_group("Limits", "how much people and strangers may take");
  limits->add_option("--max-hands", options.places.hands, "people with tools: surgeons, assistants")
      ->type_name("N")
      ->check(command_line::whole_from_to(1, kMaxHands))
      ->capture_default_str();
  limits->add_option("--max-watchers", options.places.watchers, "instructors and observers")
      ->type_name("N")
      ->check(command_line::whole_from_to(0, kMaxWatchers))
      ->capture_default_str();
  limits->add_option("--max-tools", options.places.tools, "tools of one person")
      ->type_name("N")
      ->check(command_line::whole_from_to(1, kToolsPerHand))
      ->capture_default_str();
  limits
      ->add_option("--longest-edge", options.places.longest_edge_mm,
                   "mm of a blade's edge; a longer one is refused")
      ->type_name("MM")
      ->check(command_line::whole_from_to(1, 200))
      ->capture_default_str();
  limits
      ->add_option("--max-messages", options.messages_per_second,
                   "messages of one client per second, or its session ends")
      ->type_name("N")
      ->check(command_line::whole_from_to(100u, 20'000u))
      ->capture_default_str();
  limits
      ->add_option("--max-kilobytes", options.kilobytes_per_second,
                   "kB of one client per second, or its session ends")
      ->type_name("N")
      ->check(command_line::whole_from_to(50u, 10'000u))
      ->capture_default_str();
  limits
      ->add_option("--max-message-bytes", options.message_bytes, "bytes of one message of a client")
      ->type_name("N")
      ->check(command_line::whole_from_to(1024u, wire::kMaxUpstreamBytes))
      ->capture_default_str();
  limits
      ->add_option("--max-newcomers", options.newcomers,
                   "connections that have not said who they are; the oldest makes room")
      ->type_name("N")
      ->check(command_line::whole_from_to(4, 1000))
      ->capture_default_str();
  limits
      ->add_option("--max-newcomers-per-address", options.newcomers_per_address,
                   "of these from one address")
      ->type_name("N")
      ->check(command_line::whole_from_to(4, 1000))
      ->capture_default_str();
}

struct ResearchOptions {
  bool is_frozen = false;
  const CLI::Option *depth = nullptr, *sweeps = nullptr, *averaged = nullptr;
};

// A lesson needs none of these, so --help shows them last, under a heading of their own.
void add_research_options(CLI::App& app, ServerOptions& options, ResearchOptions& more) {
  auto* research = app.add_option_group("Research", "the solver's settings");
  more.averaged = research->add_flag(
      "--averaged-strain", options.has_averaged_strain,
      "average the strain of its tets over nodes, so that they do not lock; =false: "
      "plain tets, up to 50 % too stiff [as the organ has it]");
  research->add_flag("--frozen", more.is_frozen,
                     "tissue beyond the limits stands still, as in the papers, "
                     "instead of moving with fewer sweeps");
  research->add_flag("--fixed-decisions", options.has_fixed_decisions,
                     "always do as --nodes and --sweeps say; otherwise they are the most, and less "
                     "is done when a tick would take longer than --budget");
  research
      ->add_option("--budget", options.budget_ms, "of each millisecond, how much the tick may take")
      ->type_name("MS")
      ->check(command_line::from_to(0.05, 1))
      ->capture_default_str();
  more.depth =
      research->add_option("--depth", options.decisions.depth_limit,
                           "layers around each contact that are in the queue [3, frozen: 6]");
  research
      ->add_option("--nodes", options.decisions.node_limit, "nodes that all forces together reach")
      ->capture_default_str();
  more.sweeps = research->add_option(
      "--sweeps", options.decisions.sweeps,
      "passes of the solver per tick in the queue [4; in soft organs 3, 2 and 1, as layers lie "
      "deeper]");
  research->add_option("--omega", options.decisions.over_relaxation, "over-relaxation, 1 to 1.9")
      ->capture_default_str();
  research
      ->add_option("--far-sweeps", options.decisions.far_sweeps,
                   "passes per tick for the rest of the organ, 0: as many as the organ needs")
      ->capture_default_str();
  research->add_flag("--exact-far", options.decisions.is_far_exact,
                     "forces in the rest of the organ from its material law, not from matrices "
                     "that are renewed every 64 ticks");
  research
      ->add_option("--ready-file", options.ready_file, "write the port to this file when listening")
      ->type_name("FILE");
}

// CLI11's parser of the command line with all that it writes to.
class CommandLine {
 public:
  CommandLine();

  // Checks one option alone, as if nothing else had been given.
  Status check(const std::string& key, const std::string& text);
  // Checks what is left, once all options are known.
  Status finish();

  CLI::App& app() { return app_; }
  ServerOptions& options() { return options_; }

 private:
  void add_session_options();

  ServerOptions options_;
  std::string listen_ = "127.0.0.1:7690", metrics_, page_;
  ResearchOptions research_;
  const CLI::Option* organ_ = nullptr;
  CLI::App app_{
      "Hosts one session: one organ, simulated 1000 times per second, shared by up to 16 "
      "people with tools and 100 who watch, or more with --max-watchers.",
      "trocar-server"};
};

CommandLine::CommandLine() {
  app_.footer(kExamples);
  app_.set_version_flag("--version", version_text())->configurable(false);
  app_.get_help_ptr()->configurable(false);
  add_session_options();
  add_config_options(app_, options_.checks_config, "options and files");
  add_access_options(app_, options_.access);
  add_limit_options(app_, options_.limits);
  add_research_options(app_, options_, research_);
}

void CommandLine::add_session_options() {
  organ_ =
      app_.add_option(
              "--organ", options_.organ,
              "built-in organ (liver, elastic-liver, lattice, plate, stomach, chest, pegs), an "
              ".organ file or a .msh mesh")
          ->type_name("NAME|FILE")
          ->capture_default_str();
  app_.add_option(
          "--lesson", options_.lesson_file,
          "give this lesson: " + lesson::list_lessons() + ", or a file; it brings its organ")
      ->type_name("NAME|FILE");
  app_.add_flag("--bleeding", options_.bleeds,
                "cut tissue bleeds, also without a lesson that bleeds");
  app_.add_option("--threads", options_.threads_file,
                  "surgical thread lies beside the organ as this file says, such as "
                  "deploy/threads/post.toml")
      ->type_name("FILE");
  app_.add_option("--listen", listen_, "where to listen; port 0 takes any free one")
      ->type_name("ADDR:PORT")
      ->capture_default_str();
  app_.add_flag("--browser", options_.has_page,
                "let people take part in a browser: trocar-web beside this, and a link for each "
                "role, on a terminal as a QR code, too")
      ->group("Network");
  app_.add_option("--browser-listen", page_,
                  "where browsers reach it; port 0 takes any free one [port 7691 of --listen's "
                  "address]")
      ->type_name("ADDR:PORT")
      ->group("Network");
  app_.add_flag(
          "--no-datagrams", options_.is_stream_only,
          "frames and hands over the TCP stream alone, where lost packets hold up the picture")
      ->group("Network");
  app_.add_option("--metrics", metrics_,
                  "where monitoring reads /healthz, /readyz and /metrics, without TLS [nowhere]")
      ->type_name("ADDR:PORT")
      ->group("Network");
  app_.add_flag(
          "--agones", options_.is_agones,
          "tell Agones, in a Kubernetes cluster, that the session is ready, well, busy or over")
      ->group("Network");
  app_.add_option("--announce", options_.announced_name,
                  "name of the session on the local network (DNS-SD) [the organ's and "
                  "the machine's; told unless --listen is this machine only]")
      ->type_name("NAME")
      ->check(printable_name())
      ->group("Network");
  app_.add_flag("--no-announce", options_.is_unannounced,
                "tell the local network nothing of the session")
      ->group("Network");
  app_.add_option("--journal", options_.journal,
                  "file to record the session in, or none [./trocar-<UTC>.mcap]")
      ->type_name("FILE");
  app_.add_option("--sign", options_.signing_key_file,
                  "sign the recording at its end with this private Ed25519 key (PEM)")
      ->type_name("KEY");
  app_.add_option("--resume", options_.resume_file,
                  "go on where this recording of a killed server ends; the organ is in it")
      ->type_name("FILE");
  app_.add_option("--seconds", options_.seconds, "end after this many simulated seconds")
      ->type_name("N")
      ->check(command_line::from_to(0, 1e9));
  app_.add_option("--wait-for", options_.awaited_people,
                  "let time stand still after the first frame until so many people are there")
      ->type_name("N")
      ->check(command_line::whole_from_to(0, kMaxHands + kMaxWatchers))
      ->capture_default_str();
  app_.add_option("--pace", options_.pace,
                  "let time go up to so many times as fast while all hands follow, for sessions of "
                  "scripts; ticks then do all that is asked for, as with --fixed-decisions")
      ->type_name("N")
      ->check(command_line::from_to(1, kMostPace))
      ->capture_default_str();
  app_.add_option("--summary", options_.summary_file, "write figures of the run as JSON at the end")
      ->type_name("FILE");
  app_.add_option("--workers", options_.workers,
                  "threads that share a tick's work; 0: as many as help, now one and now more")
      ->type_name("N")
      ->check(command_line::whole_from_to(0u, kMaxWorkers))
      ->capture_default_str()
      ->group("Speed");
  add_log_options(app_, options_.log_level, options_.log_format);
}

Status CommandLine::check(const std::string& key, const std::string& text) {
  return check_option(app_, key, text, [this] { return finish(); });
}

Status CommandLine::finish() {
  // Nothing is to be given up for a tick's millisecond.
  if (options_.pace > 1) options_.has_fixed_decisions = true;
  options_.is_organ_chosen = organ_->count() > 0;
  options_.are_sweeps_chosen = research_.sweeps->count() > 0;
  // CLI11 writes false where nobody has said anything.
  if (research_.averaged->count() == 0) options_.has_averaged_strain.reset();
  if (research_.is_frozen) {
    options_.decisions.boundary = world::Boundary::Frozen;
    if (research_.depth->count() == 0) options_.decisions.depth_limit = step::kFrozenDepthLimit;
  }
  if (const auto parsed = parse_listen_address(listen_, options_); !parsed) return parsed;
  if (const auto parsed = parse_metrics_address(metrics_, options_); !parsed) return parsed;
  if (const auto parsed = parse_page_address(page_, options_); !parsed) return parsed;
  return step::validate(options_.decisions);
}

}  // namespace

Status parse_listen_address(const std::string& text, ServerOptions& options) {
  return parse_place("--listen", "127.0.0.1:7690", text, options.address, options.port);
}

Status parse_page_address(const std::string& text, ServerOptions& options) {
  if (text.empty()) return {};
  options.has_page = true;
  return parse_place("--browser-listen", "0.0.0.0:7691", text, options.page_address,
                     options.page_port);
}

Status parse_metrics_address(const std::string& text, ServerOptions& options) {
  if (text.empty()) return {};
  return parse_place("--metrics", "127.0.0.1:7693", text, options.metrics_address,
                     options.metrics_port);
}

namespace {

Status read_lesson(ServerOptions& options) {
  if (options.lesson_file.empty()) return {};
  auto lesson = lesson::find_lesson(options.lesson_file);
  if (!lesson) return Error{lesson.error().code, "--lesson: " + lesson.error().message};
  if (options.is_organ_chosen && options.organ != lesson->organ)
    return Error{ErrorCode::Usage, "--lesson: its organ is " + lesson->organ + " and not " +
                                       options.organ + ", leave out --organ"};
  options.organ = lesson->organ;
  options.lesson = *std::move(lesson);
  return {};
}

Status read_threads(ServerOptions& options) {
  if (options.threads_file.empty()) return {};
  auto rules = thread::read_rules_file(options.threads_file);
  if (!rules) return Error{rules.error().code, "--threads: " + rules.error().message};
  options.threads = *std::move(rules);
  return {};
}

}  // namespace

Result<std::optional<ServerOptions>> parse_command_line(int argc, char** argv) {
  auto read = read_command_line<CommandLine>(argc, argv, kExampleFile);
  if (!read || !*read) return read;
  auto& options = **read;
  for (const auto& done : {read_lesson(options), read_threads(options)})
    if (!done) return Error{done.error().code, options.origins.placed(done.error().message)};
  if (options.journal.empty()) options.journal = default_journal_path();
  return read;
}

}  // namespace trocar::app
