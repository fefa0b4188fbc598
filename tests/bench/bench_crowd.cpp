// A crowd of watchers costs a server, or relays, CPU time and bytes. A real server with scripted
// hands, and relays if asked for, are followed by watchers in this program. These acknowledge every
// frame, as a client does, and decode none, so that the machine's cores are left to what is
// measured. Ages are by the machine's own clock, which all of them share.

#include "common/base/asio.h"  // before Boost: see there

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <atomic>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <sstream>
#include <thread>

#include "client/replica/time_distribution.h"
#include "common/base/ids.h"
#include "common/base/log.h"
#include "common/base/no_throw.h"
#include "common/base/timing.h"
#include "common/base/version.h"
#include "common/secure/link_file.h"
#include "proto/wire.pb.h"
#include "server/watch/follow/session_link.h"
#include "tests/support/child_program.h"
#include "tests/support/process_cpu.h"

namespace trocar {
namespace {

namespace fs = std::filesystem;
using testing::Program;

constexpr double kStartSeconds = 60;
constexpr std::uint64_t kPingNs = 500'000'000;
constexpr std::chrono::milliseconds kLookPeriod{10}, kRetry{200};

struct Options {
  std::string organ = "lattice";
  double seconds = 10, settle_seconds = 15;
  std::vector<int> watchers{100};
  int hands = 8, relays = 0;
  std::string nats;  // URL; empty: each relay hangs on the server
  unsigned threads = 1;
};

// Figures of a program on this machine, as /metrics has them; empty if it does not answer.
std::string figures_at(std::uint16_t port) {
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(port);
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  static constexpr std::string_view kRequest = "GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n";
  std::string text;
  if (::connect(socket, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0 &&
      ::send(socket, kRequest.data(), kRequest.size(), 0) > 0) {
    std::array<char, 4096> buffer{};
    for (ssize_t count = 0; (count = ::recv(socket, buffer.data(), buffer.size(), 0)) > 0;)
      text.append(buffer.data(), static_cast<std::size_t>(count));
  }
  ::close(socket);
  return text;
}

// The sum of all series of a figure.
double sum_of(const std::string& figures, const std::string& name) {
  double sum = 0;
  std::istringstream lines(figures);
  for (std::string line; std::getline(lines, line);)
    if (line.starts_with(name + "{") || line.starts_with(name + " "))
      sum += std::atof(line.substr(line.rfind(' ')).c_str());
  return sum;
}

struct Watcher {
  follow::SessionAddress place;
  secure::JoinCode code;
  std::uint64_t server_us = 0;  // when the newest frame was published; 0: none has come
  std::uint64_t frames = 0, joins = 0;
};

// One thread with its share of the watchers.
class Share {
 public:
  explicit Share(const std::vector<follow::SessionAddress>& places) : sessions_(places) {}

  void add(const follow::SessionAddress& place, const secure::JoinCode& code) {
    watchers_.push_back(std::make_unique<Watcher>(Watcher{.place = place, .code = code}));
    asio::co_spawn(io_, watch(*watchers_.back()), rethrow);
  }
  void start() {
    asio::co_spawn(io_, look(), rethrow);
    thread_ = std::thread([this] { io_.run(); });
  }
  void stop() {
    is_over_ = true;
    io_.stop();
    thread_.join();
  }

  std::atomic<bool> is_counting{false};
  // These are to be read after stop().
  const std::vector<std::unique_ptr<Watcher>>& watchers() const { return watchers_; }
  const std::vector<double>& ages_ms() const { return ages_ms_; }
  std::uint64_t frames() const { return frames_; }

 private:
  asio::awaitable<void> watch(Watcher& watcher) {
    asio::steady_timer pause(io_);
    std::unique_ptr<follow::SessionLink> link;
    while (!is_over_) {
      link = std::make_unique<follow::SessionLink>(io_.get_executor(), sessions_);
      const bool is_open = co_await link->open(watcher.place);
      if (is_open) co_await stay(watcher, *link);
      pause.expires_after(kRetry);
      co_await pause.async_wait(kNoThrow);
    }
  }
  asio::awaitable<void> stay(Watcher& watcher, follow::SessionLink& link) {
    const auto hello = hello_of(watcher.code, number_++);
    const BytesView greeting(*hello);
    bool is_there = co_await link.write(greeting);
    Bytes body;
    std::uint64_t pinged_ns = 0;
    while (is_there) {
      is_there = co_await link.read(body);
      proto::Envelope message;
      if (!is_there || !wire::decode_envelope(body, message).ok()) break;
      watcher.joins += message.has_welcome();
      wire::SharedBytes answer;
      if (message.has_surface_frame()) {
        watcher.server_us = message.surface_frame().server_time_us();
        frames_ += is_counting;
        proto::Envelope ack;
        ack.mutable_frame_ack()->set_frame(message.surface_frame().frame());
        answer = wire::encode_envelope(ack);
      } else if (watcher.joins > 0 && monotonic_ns() - pinged_ns > kPingNs) {
        pinged_ns = monotonic_ns();
        proto::Envelope ping;
        ping.mutable_ping()->set_client_time_us(pinged_ns / 1000);
        answer = wire::encode_envelope(ping);
      }
      if (!answer) continue;
      const BytesView bytes(*answer);
      is_there = co_await link.write(bytes);
    }
  }
  static wire::SharedBytes hello_of(const secure::JoinCode& code, int number) {
    proto::Envelope envelope;
    auto& hello = *envelope.mutable_hello();
    hello.set_protocol_major(kProtocolMajor);
    hello.set_protocol_minor(kProtocolMinor);
    hello.set_name("Watcher " + std::to_string(number));
    hello.set_role(proto::ROLE_OBSERVER);
    hello.set_join_secret(code.secret.data(), code.secret.size());
    hello.set_acks_every_frame(true);
    return wire::encode_envelope(envelope);
  }
  asio::awaitable<void> look() {
    asio::steady_timer next(io_);
    while (!is_over_) {
      next.expires_after(kLookPeriod);
      co_await next.async_wait(kNoThrow);
      if (!is_counting) continue;
      const auto now_us = monotonic_ns() / 1000;
      for (const auto& watcher : watchers_)
        if (watcher->server_us != 0)
          ages_ms_.push_back(static_cast<double>(now_us - std::min(now_us, watcher->server_us)) *
                             1e-3);
    }
  }

  static inline std::atomic<int> number_{0};
  follow::Sessions sessions_;
  std::vector<std::unique_ptr<Watcher>> watchers_;
  std::vector<double> ages_ms_;
  std::atomic<bool> is_over_{false};
  std::uint64_t frames_ = 0;
  asio::io_context io_{1};  // its coroutines use what stands above
  std::thread thread_;
};

class Crowd {
 public:
  explicit Crowd(const Options& options) {
    setenv("XDG_STATE_HOME", (folder_ / "state").c_str(), 1);
    setenv("XDG_RUNTIME_DIR", folder_.c_str(), 1);
    start("trocar-server", "server",
          {"--organ", options.organ, "--journal", "none", "--max-watchers",
           std::to_string(kMaxWatchers), "--max-newcomers", "1000", "--max-newcomers-per-address",
           "1000"});
    const auto server = ports_.front();
    static const std::vector<std::string> kHands{"palpate", "press",   "stroke", "lift",
                                                 "probe",   "spatula", "tug",    "slices"};
    for (int i = 0; i < options.hands; ++i) {
      const auto& script = kHands[static_cast<std::size_t>(i) % kHands.size()];
      const auto name = "Hand " + std::to_string(i);
      hands_.push_back(std::make_unique<Program>(
          "trocar-client",
          std::vector<std::string>{"--server", "127.0.0.1:" + std::to_string(server), "--name",
                                   name, "--no-render", "--script",
                                   TROCAR_SOURCE_DIR "/deploy/scenes/" + script + ".toml"},
          folder_ / (name + ".log")));
    }
    const auto to = "127.0.0.1:" + std::to_string(server);
    for (int i = 0; i < options.relays; ++i) {
      std::vector<std::string> arguments{"--to", to, "--max-watchers", "10000"};
      if (!options.nats.empty()) add_nats(options.nats, i == 0, server, arguments);
      start("trocar-relay", "relay" + std::to_string(i), arguments);
    }
  }
  ~Crowd() {
    for (const auto& program : programs_) program->signal(SIGTERM);
    for (const auto& program : programs_) program->wait(10);
    for (auto& hand : hands_) hand->wait(5);
    fs::remove_all(folder_);
  }

  // Watchers go to these: relays, if there are some.
  std::vector<std::uint16_t> places() const {
    return ports_.size() > 1 ? std::vector<std::uint16_t>(ports_.begin() + 1, ports_.end())
                             : ports_;
  }
  double cpu_of_server() const {
    return testing::cpu_seconds_of_first_thread(programs_.front()->process());
  }
  double cpu_of_relays() const {
    double seconds = 0;
    for (std::size_t i = 1; i < programs_.size(); ++i)
      seconds += testing::cpu_seconds_of_first_thread(programs_[i]->process());
    return seconds;
  }
  double bytes_of_server() const {
    return sum_of(figures_at(metrics_.front()), "trocar_sent_bytes_total");
  }
  double bytes_of_relays() const {
    double bytes = 0;
    for (std::size_t i = 1; i < metrics_.size(); ++i)
      bytes += sum_of(figures_at(metrics_[i]), "trocar_relay_sent_bytes_total");
    return bytes;
  }

 private:
  // The first relay publishes the session, and the others take it from there.
  static void add_nats(const std::string& url, bool is_first, std::uint16_t server,
                       std::vector<std::string>& arguments) {
    const auto name = "bench-" + std::to_string(::getpid());
    arguments.insert(arguments.end(),
                     {"--nats", url, is_first ? "--publish" : "--from-nats", name});
    const auto code = secure::read_link_file(server, "observer");
    if (!is_first && code) arguments.insert(arguments.end(), {"--code", secure::to_text(*code)});
  }
  void start(const std::string& program, const std::string& name,
             std::vector<std::string> arguments) {
    static std::uint16_t next_metrics = 17'930;
    metrics_.push_back(next_metrics++);
    const auto ready = folder_ / (name + ".port");
    arguments.insert(arguments.end(),
                     {"--listen", "127.0.0.1:0", "--ready-file", ready.string(), "--log-level",
                      "warn", "--metrics", "127.0.0.1:" + std::to_string(metrics_.back())});
    programs_.push_back(std::make_unique<Program>(program, arguments, folder_ / (name + ".log")));
    int port = 0;
    for (int i = 0; i < kStartSeconds * 20 && port == 0; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      port = std::atoi(testing::load_text(ready).c_str());
    }
    if (port == 0) std::fputs(testing::load_text(folder_ / (name + ".log")).c_str(), stderr);
    ports_.push_back(static_cast<std::uint16_t>(port));
  }

  const fs::path folder_ = [] {
    std::string name = (fs::temp_directory_path() / "trocar-crowd-XXXXXX").string();
    return fs::path(mkdtemp(name.data()));
  }();
  std::vector<std::unique_ptr<Program>> programs_;  // the server first
  std::vector<std::unique_ptr<Program>> hands_;
  std::vector<std::uint16_t> ports_, metrics_;  // likewise
};

void run(const Options& options, int count) {
  Crowd crowd(options);
  std::vector<follow::SessionAddress> places;
  for (const auto port : crowd.places())
    places.push_back({"127.0.0.1:" + std::to_string(port), "127.0.0.1", port});
  const auto code = secure::read_link_file(places.front().port, "observer");
  if (!code) {
    std::fprintf(stderr, "bench_crowd: %s\n", code.error().message.c_str());
    std::exit(1);
  }
  std::vector<std::unique_ptr<Share>> shares;
  for (unsigned i = 0; i < options.threads; ++i) shares.push_back(std::make_unique<Share>(places));
  for (int i = 0; i < count; ++i) {
    const auto number = static_cast<std::size_t>(i);
    shares[number % shares.size()]->add(places[number % places.size()], *code);
  }
  for (auto& share : shares) share->start();
  std::this_thread::sleep_for(std::chrono::duration<double>(options.settle_seconds));
  for (auto& share : shares) share->is_counting = true;
  const double server_cpu = crowd.cpu_of_server(), relay_cpu = crowd.cpu_of_relays();
  const double server_bytes = crowd.bytes_of_server(), relay_bytes = crowd.bytes_of_relays();
  std::this_thread::sleep_for(std::chrono::duration<double>(options.seconds));
  const double server_used = crowd.cpu_of_server() - server_cpu;
  const double relay_used = crowd.cpu_of_relays() - relay_cpu;
  const double server_sent = crowd.bytes_of_server() - server_bytes;
  const double relay_sent = crowd.bytes_of_relays() - relay_bytes;
  replica::TimeDistribution ages;
  std::uint64_t frames = 0, lost = 0;
  for (auto& share : shares) {
    share->stop();
    for (const double age : share->ages_ms()) ages.add(age);
    frames += share->frames();
    for (const auto& watcher : share->watchers())
      lost += watcher->joins != 1 || watcher->server_us == 0;
  }
  const double to_percent = 100 / options.seconds, to_kb = 1e-3 / options.seconds;
  std::printf("| %d | %d | %.1f | %.3f | %.1f | %.3f | %.0f | %.0f | %.0f | %.0f | %.0f | %llu |\n",
              options.relays, count, server_used * to_percent, server_used * to_percent / count,
              relay_used * to_percent, relay_used * to_percent / count, server_sent * to_kb,
              relay_sent * to_kb, ages.quantile_ms(0.5), ages.quantile_ms(0.99),
              static_cast<double>(frames) / options.seconds / count,
              static_cast<unsigned long long>(lost));
  std::fflush(stdout);
}

}  // namespace
}  // namespace trocar

int main(int argc, char** argv) {
  using namespace trocar;  // NOLINT: a program's own file
  Options options;
  CLI::App app{"What a crowd of watchers costs a server, or relays between."};
  app.add_option("--organ", options.organ, "built-in organ or file")->capture_default_str();
  app.add_option("--seconds", options.seconds, "measured, of each session")->capture_default_str();
  app.add_option("--settle", options.settle_seconds, "before that, while they come")
      ->capture_default_str();
  app.add_option("--watchers", options.watchers, "how many, one session each")
      ->capture_default_str();
  app.add_option("--relays", options.relays, "between server and watchers; 0: none")
      ->check(CLI::Range(0, 16));
  app.add_option("--nats", options.nats,
                 "a NATS that runs, over which all relays but the first have the session")
      ->type_name("URL");
  app.add_option("--hands", options.hands, "scripted ones")->check(CLI::Range(0, kMaxHands));
  app.add_option("--threads", options.threads, "of the watchers")->check(CLI::Range(1, 64));
  CLI11_PARSE(app, argc, argv);
  if (!log::configure("bench_crowd", "error")) return 2;
  std::printf(
      "| relays | watchers | server's network thread (%% of a core) | of it per watcher | relays "
      "(%% of a core) | of it per watcher | from the server (kB/s) | from the relays (kB/s) | age, "
      "median (ms) | 99th | frames/s | lost |\n"
      "|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  for (const int count : options.watchers) run(options, count);
  return 0;
}
