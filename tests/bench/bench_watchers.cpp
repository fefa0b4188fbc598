// Watchers cost a server CPU time and bytes. A real server with scripted hands is followed by
// watchers in this program, and some that stop reading, which are stopped processes. It prints the
// CPU time of the server's network thread, bytes, and the age of the watchers' surface: with TLS
// and datagrams, with TLS alone, and without either.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <thread>

#include "client/net/net_source.h"
#include "client/replica/replica.h"
#include "client/replica/time_distribution.h"
#include "common/base/log.h"
#include "common/base/timing.h"
#include "common/secure/link_file.h"
#include "tests/bench/resident_memory.h"
#include "tests/support/child_program.h"
#include "tests/support/process_cpu.h"

namespace trocar {
namespace {

namespace fs = std::filesystem;
using testing::Program;

constexpr double kStartSeconds = 60, kSettleSeconds = 8;

enum class Kind { Datagrams, Tls, Plain };
const char* name_of(Kind kind) {
  return kind == Kind::Datagrams ? "TLS, datagrams" : kind == Kind::Tls ? "TLS" : "neither";
}

struct Options {
  std::string organ = "lattice";
  double seconds = 10;
  std::vector<int> watchers{10, 30, 100};
  int hands = 1, stopped = 0;
  bool has_all_kinds = true;  // of connections
  unsigned threads = 1;
};

struct Watcher {
  explicit Watcher(net::NetSourceOptions options)
      : source(std::move(options)),
        replica([this](const proto::Envelope& message) { return source.send(message); }) {}
  net::NetSource source;
  replica::Replica replica;
};

class Session {
 public:
  Session(const Options& options, Kind kind) : kind_(kind) {
    setenv("XDG_STATE_HOME", (folder_ / "state").c_str(), 1);
    setenv("XDG_RUNTIME_DIR", folder_.c_str(), 1);
    std::vector<std::string> arguments{
        "--organ",     options.organ, "--listen",     "127.0.0.1:0",
        "--journal",   "none",        "--ready-file", (folder_ / "port").string(),
        "--log-level", "warn"};
    if (kind == Kind::Plain) arguments.push_back("--insecure-loopback");
    server_ = std::make_unique<Program>("trocar-server", arguments, folder_ / "server.log");
    for (int i = 0; i < kStartSeconds * 20 && port_ == 0; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      port_ = static_cast<std::uint16_t>(std::atoi(testing::load_text(folder_ / "port").c_str()));
    }
    static const std::vector<std::string> kHands{"palpate", "press",   "stroke", "lift",
                                                 "probe",   "spatula", "tug",    "slices"};
    for (int i = 0; i < options.hands; ++i) {
      const auto& script = kHands[static_cast<std::size_t>(i) % kHands.size()];
      start_client("Hand " + std::to_string(i),
                   {"--script", TROCAR_SOURCE_DIR "/deploy/scenes/" + script + ".toml"});
    }
    for (int i = 0; i < options.stopped; ++i)
      start_client("Stopped " + std::to_string(i), {"--role", "observer"});
    stopped_ = static_cast<std::size_t>(options.stopped);
  }
  ~Session() {
    for (std::size_t i = clients_.size() - stopped_; i < clients_.size(); ++i)
      clients_[i]->signal(SIGKILL);
    server_->signal(SIGTERM);
    server_->wait(10);
    for (auto& client : clients_) client->wait(5);
    fs::remove_all(folder_);
  }

  // From now on they read nothing.
  void stop_clients() {
    for (std::size_t i = clients_.size() - stopped_; i < clients_.size(); ++i)
      clients_[i]->signal(SIGSTOP);
  }

  pid_t process() const { return server_->process(); }
  net::NetSourceOptions watcher_options(int number) const {
    net::NetSourceOptions options;
    options.port = port_;
    options.participant_name = "Watcher " + std::to_string(number);
    options.role = static_cast<int>(wire::Role::Observer);
    options.wants_datagrams = kind_ == Kind::Datagrams;
    if (kind_ == Kind::Plain) return options;
    options.tls = secure::make_client_context();
    options.join_code = [port = port_] { return secure::read_link_file(port, "observer"); };
    return options;
  }

 private:
  void start_client(const std::string& name, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"--server", "127.0.0.1:" + std::to_string(port_), "--name",
                                       name, "--no-render"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    if (kind_ == Kind::Plain) arguments.push_back("--insecure-loopback");
    clients_.push_back(
        std::make_unique<Program>("trocar-client", arguments, folder_ / (name + ".log")));
  }

  const Kind kind_;
  const fs::path folder_ = [] {
    std::string name = (fs::temp_directory_path() / "trocar-watchers-XXXXXX").string();
    return fs::path(mkdtemp(name.data()));
  }();
  std::uint16_t port_ = 0;
  std::unique_ptr<Program> server_;
  std::vector<std::unique_ptr<Program>> clients_;  // hands first
  std::size_t stopped_ = 0;
};

// Polls a share of the watchers until told to stop; ages count while `is_counting`.
void follow(std::vector<std::unique_ptr<Watcher>>& watchers, std::size_t first, std::size_t step,
            const std::atomic<bool>& is_stopped, const std::atomic<bool>& is_counting,
            replica::TimeDistribution& ages) {
  while (!is_stopped) {
    for (std::size_t i = first; i < watchers.size(); i += step) {
      auto& watcher = *watchers[i];
      watcher.source.poll(watcher.replica);
      const auto statistics = watcher.source.statistics();
      if (!is_counting || !statistics.has_server_clock) continue;
      const auto now_us = static_cast<double>(monotonic_ns()) * 1e-3;
      if (const auto age = watcher.replica.age_ms(now_us + statistics.server_offset_us))
        ages.add(*age);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(4));
  }
}

void run(const Options& options, Kind kind, int count) {
  Session session(options, kind);
  std::vector<std::unique_ptr<Watcher>> watchers;
  for (int i = 0; i < count; ++i)
    watchers.push_back(std::make_unique<Watcher>(session.watcher_options(i)));
  std::atomic<bool> is_stopped{false}, is_counting{false};
  std::vector<replica::TimeDistribution> ages(options.threads);
  std::vector<std::thread> threads;
  for (unsigned i = 0; i < options.threads; ++i)
    threads.emplace_back(
        [&, i] { follow(watchers, i, options.threads, is_stopped, is_counting, ages[i]); });
  std::this_thread::sleep_for(std::chrono::duration<double>(kSettleSeconds));
  session.stop_clients();
  const auto received = [&] {
    std::uint64_t bytes = 0;
    for (const auto& watcher : watchers) {
      const auto statistics = watcher->source.statistics();
      bytes += statistics.bytes_received + statistics.datagram_bytes_received;
    }
    return static_cast<double>(bytes);
  };
  is_counting = true;
  const double cpu = testing::cpu_seconds_of_first_thread(session.process()), bytes = received();
  std::this_thread::sleep_for(std::chrono::duration<double>(options.seconds));
  const double cpu_used = testing::cpu_seconds_of_first_thread(session.process()) - cpu;
  const double bytes_got = received() - bytes,
               memory = bench::resident_mb(std::to_string(session.process()));
  is_stopped = true;
  for (auto& thread : threads) thread.join();
  std::uint64_t frames = 0, by_datagram = 0, faults = 0;
  for (const auto& watcher : watchers) {
    frames += watcher->replica.counters().frames;
    by_datagram += watcher->replica.counters().by_datagram;
    faults += !watcher->replica.fault().ok() || watcher->replica.newest() == nullptr;
  }
  const double per_watcher = 100 * cpu_used / options.seconds / count;
  std::printf("| %s | %d | %.1f | %.3f | %.0f | %.0f | %.0f | %.0f | %.0f | %.0f | %llu |\n",
              name_of(kind), count, 100 * cpu_used / options.seconds, per_watcher,
              bytes_got * 8e-3 / options.seconds / count, ages[0].quantile_ms(0.5),
              ages[0].quantile_ms(0.99),
              static_cast<double>(frames) / (options.seconds + kSettleSeconds) / count,
              100.0 * static_cast<double>(by_datagram) /
                  static_cast<double>(std::max<std::uint64_t>(1, frames)),
              memory, static_cast<unsigned long long>(faults));
  std::fflush(stdout);
}

}  // namespace
}  // namespace trocar

int main(int argc, char** argv) {
  using namespace trocar;  // NOLINT: a program's own file
  Options options;
  CLI::App app{"What watchers cost a server, with and without TLS and datagrams."};
  app.add_option("--organ", options.organ, "built-in organ or file")->capture_default_str();
  app.add_option("--seconds", options.seconds, "measured, of each session")->capture_default_str();
  app.add_option("--watchers", options.watchers, "how many, one session each")
      ->capture_default_str();
  app.add_option("--hands", options.hands, "scripted ones")->check(CLI::Range(1, kMaxHands));
  app.add_option("--stopped", options.stopped, "further watchers that stop reading")
      ->check(CLI::Range(0, 10));
  app.add_flag("!--datagrams-only", options.has_all_kinds, "not without TLS or datagrams");
  app.add_option("--threads", options.threads, "that follow them")->check(CLI::Range(1, 64));
  CLI11_PARSE(app, argc, argv);
  if (!log::configure("bench_watchers", "error")) return 2;
  std::printf(
      "| with | watchers | network thread (%% of a core) | of it per watcher | kbit/s each | "
      "age, median (ms) | 99th | frames/s | by datagram (%%) | server's memory (MB) | lost |\n"
      "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  for (const int count : options.watchers)
    for (const auto kind : {Kind::Plain, Kind::Tls, Kind::Datagrams})
      if (kind == Kind::Datagrams || options.has_all_kinds) run(options, kind, count);
  return 0;
}
