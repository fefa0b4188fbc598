#include "server/app/impair/options.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>

#include "common/base/version.h"
#include "common/command_line/command_line.h"
#include "common/command_line/limits.h"

namespace trocar::app {
namespace {

constexpr double kMostDelayMs = 10'000;
constexpr double kMostLossPercent = 90;
constexpr double kMostSeconds = 1e6;
constexpr double kBytesPerKilobit = 125;

constexpr const char* kModel = R"(
Examples:
  trocar-impair --to 127.0.0.1:7690 --delay 30 --jitter 5 --loss 1
      60 ms there and back, one packet in a hundred lost; then, beside it:
      trocar-client --server 127.0.0.1:7700
  trocar-impair --up-delay 10 --down-delay 80 --down-rate 2000 --queue 200
      the way to the client is slow: 2 Mbit/s before which 200 ms of packets may wait
  trocar-impair --block-datagrams 10:5 --cut-stream 30:2 --seconds 60 --summary out/network.json
      no datagrams from second 10 to 15; nothing on the stream from second 30 to 32

Up is from the client to the server. Equal packets in equal order meet the same fate with the same
--seed: each direction of each stream and of each peer of datagrams draws for itself. --rate and
--queue are shared by all that goes one way.

Loss on a stream. A proxy above TCP cannot lose a stream's segments, so it does what TCP does about
losses: bytes are cut into segments of 1,400. A lost one arrives later, and all after it wait. It is
sent again after one round trip if three segments that follow within a round trip arrive, otherwise
after 200 ms (or a round trip if that is longer). It may be lost again; each timeout is twice the one
before. In --cut-stream everything is lost, and the stream goes on with the first try afterwards.
The handshake, congestion control and lost acknowledgements are not modelled.

Limits: 64 streams and 256 peers of datagrams, who are forgotten after 60 s of silence.
Exit codes: 0 ok, also after Ctrl-C or SIGTERM; 2 command line, 3 bad file, 5 port taken, machine
not known or processor too old.
)";

// Holds what one direction is told, in the units of the command line.
struct DirectionText {
  std::optional<double> delay_ms, jitter_ms, loss_percent, rate_kbit;
};

impair::Time time_of(double milliseconds) {
  return impair::Time(std::llround(milliseconds * 1e6));
}

void add_direction_options(CLI::App& app, const std::string& prefix, const std::string& which,
                           DirectionText& text) {
  app.add_option("--" + prefix + "delay", text.delay_ms, "one way" + which)
      ->type_name("MS")
      ->check(command_line::from_to(0.0, kMostDelayMs));
  app.add_option("--" + prefix + "jitter", text.jitter_ms, "up to so much more, uniform" + which)
      ->type_name("MS")
      ->check(command_line::from_to(0.0, kMostDelayMs));
  app.add_option("--" + prefix + "loss", text.loss_percent, "packets that are lost" + which)
      ->type_name("PERCENT")
      ->check(command_line::from_to(0.0, kMostLossPercent));
  app.add_option("--" + prefix + "rate", text.rate_kbit, "kbit/s that get through" + which)
      ->type_name("KBIT")
      ->check(command_line::from_to(8.0, 1e7));
}

void apply(const DirectionText& text, impair::Impairment& impairment) {
  if (text.delay_ms) impairment.delay = time_of(*text.delay_ms);
  if (text.jitter_ms) impairment.jitter = time_of(*text.jitter_ms);
  if (text.loss_percent) impairment.loss = *text.loss_percent * 1e-2;
  if (text.rate_kbit) impairment.rate = *text.rate_kbit * kBytesPerKilobit;
}

bool parse_seconds(std::string_view text, double& seconds) {
  const auto parsed = std::from_chars(text.data(), text.data() + text.size(), seconds);
  return parsed.ec == std::errc{} && parsed.ptr == text.data() + text.size() && seconds >= 0 &&
         seconds <= kMostSeconds;
}

Status parse_place(const std::string& option, const std::string& text, std::string& host,
                   std::uint16_t& port) {
  const Error bad{ErrorCode::Usage,
                  option + ": '" + text + "' is not ADDRESS:PORT, such as 127.0.0.1:7690"};
  const auto colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) return bad;
  host = text.substr(0, colon);
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  const char* end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data() + colon + 1, end, port);
  if (host.empty() || parsed.ec != std::errc{} || parsed.ptr != end) return bad;
  return {};
}

Status check_burst(const char* option, const impair::Impairment& impairment) {
  const double shortest = impair::shortest_burst(impairment.loss);
  if (impairment.burst <= 0 || impairment.burst >= shortest) return {};
  return Error{ErrorCode::Usage,
               fmt::format("--burst: {} is too short for {} {}: at least {:.2f} packets in a row "
                           "are lost on average then",
                           impairment.burst, option, impairment.loss * 1e2, shortest)};
}

}  // namespace

Result<impair::Outage> parse_outage(const std::string& option, const std::string& text) {
  impair::Outage outage{.begin = impair::Time(0)};
  if (text.empty()) return outage;
  const std::string_view all = text;
  const auto colon = all.find(':');
  double after = 0, length = 0;
  const bool is_valid =
      parse_seconds(all.substr(0, colon), after) &&
      (colon == std::string_view::npos || parse_seconds(all.substr(colon + 1), length));
  if (!is_valid)
    return Error{ErrorCode::Usage,
                 option + ": '" + text +
                     "' is not AFTER_S[:FOR_S], two numbers of seconds from 0 to 1000000, such as "
                     "10:5"};
  outage.begin = time_of(after * 1e3);
  if (colon != std::string_view::npos) outage.end = outage.begin + time_of(length * 1e3);
  return outage;
}

Result<std::optional<ImpairOptions>> parse_impair_command_line(int argc, char** argv) {
  ImpairOptions options;
  std::string listen = "127.0.0.1:7700", to = "127.0.0.1:7690", blocked, cut;
  DirectionText both, up, down;
  double burst = 0, reorder = 0, duplicate = 0, queue_ms = 100;
  CLI::App app(
      "Passes a stream (TCP) and datagrams (UDP) on through a bad network: to feel, test or "
      "measure "
      "a session over it.",
      "trocar-impair");
  app.footer(kModel);
  app.set_version_flag("--version", std::string("trocar-impair ") + kVersion);
  app.add_option("--listen", listen, "where to listen, for both; port 0 takes any free one")
      ->type_name("ADDR:PORT")
      ->capture_default_str();
  app.add_option("--to", to, "the server behind the bad network")
      ->type_name("HOST:PORT")
      ->capture_default_str();
  add_direction_options(app, "", "", both);
  add_direction_options(app, "up-", ", to the server", up);
  add_direction_options(app, "down-", ", to the client", down);
  app.add_option("--burst", burst, "mean length of runs of lost packets [each by itself]")
      ->type_name("N")
      ->check(command_line::from_to(1.0, 1000.0));
  app.add_option("--reorder", reorder, "datagrams that the next one overtakes")
      ->type_name("PERCENT")
      ->check(command_line::from_to(0.0, 50.0));
  app.add_option("--duplicate", duplicate, "datagrams that arrive twice")
      ->type_name("PERCENT")
      ->check(command_line::from_to(0.0, 100.0));
  app.add_option("--queue", queue_ms,
                 "longest backlog before --rate: then datagrams are dropped, and the stream waits")
      ->type_name("MS")
      ->check(command_line::from_to(1.0, kMostDelayMs))
      ->capture_default_str();
  auto* block = app.add_option("--block-datagrams", blocked,
                               "none pass, after so many seconds, for so many [at once, for good]")
                    ->type_name("AFTER_S[:FOR_S]")
                    ->expected(0, 1);
  app.add_option("--cut-stream", cut,
                 "nothing of the stream passes then; connections stay, and go on afterwards")
      ->type_name("AFTER_S[:FOR_S]");
  app.add_option("--seed", options.proxy.seed, "of all that chance decides")
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--seconds", options.seconds, "end after so many [Ctrl-C]")
      ->type_name("N")
      ->check(command_line::from_to(0.001, kMostSeconds));
  app.add_option("--summary", options.summary_file,
                 "write what became of packets as JSON at the end")
      ->type_name("FILE");
  app.add_option("--ready-file", options.ready_file, "write the port to this file when listening")
      ->type_name("FILE");
  app.add_option("--log-level", options.log_level, "error, warn, info, debug or off")
      ->capture_default_str();
  const auto parsed = command_line::parse_command_line(app, argc, argv);
  if (!parsed) return parsed.error();
  if (!*parsed) return std::optional<ImpairOptions>();
  auto& proxy = options.proxy;
  if (auto s = parse_place("--listen", listen, proxy.listen_address, proxy.listen_port); !s)
    return s.error();
  if (auto s = parse_place("--to", to, proxy.server_host, proxy.server_port); !s) return s.error();
  if (block->count() > 0) {
    const auto outage = parse_outage("--block-datagrams", blocked);
    if (!outage) return outage.error();
    proxy.blocked = *outage;
  }
  if (!cut.empty()) {
    const auto outage = parse_outage("--cut-stream", cut);
    if (!outage) return outage.error();
    proxy.cut = *outage;
  }
  for (auto* impairment : {&proxy.up, &proxy.down}) {
    *impairment = {.burst = burst,
                   .reorder = reorder * 1e-2,
                   .duplicate = duplicate * 1e-2,
                   .queue = time_of(queue_ms)};
    apply(both, *impairment);
    apply(impairment == &proxy.up ? up : down, *impairment);
    if (const auto s = check_burst("--loss", *impairment); !s) return s.error();
  }
  return std::optional(std::move(options));
}

std::string describe(const impair::Impairment& impairment) {
  const auto ms = [](impair::Time time) {
    return std::chrono::duration<double, std::milli>(time).count();
  };
  std::string text = fmt::format("{} ms", ms(impairment.delay));
  if (impairment.jitter.count() > 0)
    text += fmt::format(" and up to {} more", ms(impairment.jitter));
  if (impairment.loss > 0) text += fmt::format(", {:.3g} % lost", impairment.loss * 1e2);
  if (impairment.rate > 0) text += fmt::format(", {} kbit/s", impairment.rate / kBytesPerKilobit);
  return text;
}

}  // namespace trocar::app
