// A session over a bad network, with the real programs: a server, clients that play scripts, and
// trocar-impair between them. For each network it tells how old the surface is that clients have,
// how long a hand and a cut take until they are seen, and what it costs; once with datagrams and
// once over the stream alone. All replicas must equal the server's in the end.
//
// Ages are of the newest surface that a client has, every 4 ms: 16 ms between frames are in them, a
// window's delay of 24 ms is not.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>
#include <thread>

#include "common/plot/plot.h"
#include "tests/support/child_program.h"
#include "tests/support/files.h"

namespace trocar {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using testing::Program;
using Arguments = std::vector<std::string>;

constexpr const char* kProgram = "bench_network";
constexpr double kStartSeconds = 120;
// At 5 % loss half the round trip, three frames and 40 ms are asked for.
constexpr double kFramesMs = 3 * 16, kMarginMs = 40;

struct Options {
  std::string out = "out/network", only = ".", organ = "elastic-liver";
  double seconds = 15;
  bool is_short = false;
};

struct Condition {
  std::string name;
  double round_trip_ms = 0, loss_percent = 0;
  Arguments impair;  // besides delay and loss
  int hands = 8;
};

struct Times {
  double median = 0, p99 = 0;
};

struct Row {
  Condition condition;
  bool has_datagrams = false;
  Times age, hand, cut;  // ms; of the median client, and its 99th percentile
  double worst_age = 0;  // the 99th percentile of the worst client
  double frames_per_s = 0, down_kbit = 0;
  int different = 0, unheard = 0;  // replicas in the end: another CRC, and none in time
};

std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::vector<Condition> conditions(bool is_short) {
  std::vector<Condition> all;
  const std::vector<double> trips =
      is_short ? std::vector{60.0} : std::vector{2.0, 20.0, 60.0, 150.0};
  const std::vector<double> losses =
      is_short ? std::vector{0.0, 5.0} : std::vector{0.0, 1.0, 5.0, 20.0};
  for (const double trip : trips)
    for (const double loss : losses)
      all.push_back({number(trip) + " ms, " + number(loss) + " %", trip, loss, {}});
  if (is_short) return all;
  all.push_back({"reordering 10 %", 60, 1, {"--reorder", "10", "--jitter", "5"}});
  all.push_back({"duplicates 20 %", 60, 1, {"--duplicate", "20"}});
  all.push_back({"bursts of 5", 60, 5, {"--burst", "5"}});
  all.push_back({"5 Mbit/s", 20, 0, {"--rate", "5000"}});
  all.push_back({"1 Mbit/s, 3 clients", 20, 0, {"--rate", "1000"}, 3});
  all.push_back({"datagrams blocked for 4 s", 60, 0, {"--block-datagrams", "6:4"}});
  return all;
}

// The port that a program has written; empty if it did not start.
std::string wait_for_port(const fs::path& file) {
  for (int i = 0; i < static_cast<int>(kStartSeconds * 20); ++i) {
    std::string port = testing::load_text(file);
    if (const auto end = port.find('\n'); end != std::string::npos) return port.substr(0, end);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return {};
}

double middle(std::vector<double> values) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[values.size() / 2];
}

Times middle_of(const std::vector<Json>& clients, const char* key) {
  std::vector<double> medians, p99s;
  for (const auto& client : clients) {
    if (client[key]["count"].get<double>() < 5) continue;
    medians.push_back(client[key]["median"].get<double>());
    p99s.push_back(client[key]["p99"].get<double>());
  }
  return {middle(medians), middle(p99s)};
}

Row summarise(const Condition& condition, bool has_datagrams, const Json& server,
              const std::vector<Json>& clients) {
  Row row{.condition = condition, .has_datagrams = has_datagrams};
  row.age = middle_of(clients, "surface_age_ms");
  row.hand = middle_of(clients, "hand_to_visible_ms");
  row.cut = middle_of(clients, "cut_to_visible_ms");
  std::vector<double> frames, kbit;
  for (const auto& client : clients) {
    const auto seconds = client["wall_seconds"].get<double>();
    row.worst_age = std::max(row.worst_age, client["surface_age_ms"]["p99"].get<double>());
    frames.push_back(client["frames"].get<double>() / seconds);
    kbit.push_back(client["bytes_received"].get<double>() * 8e-3 / seconds);
  }
  row.frames_per_s = middle(frames);
  row.down_kbit = middle(kbit);
  for (const auto& participant : server["participants"]) {
    const bool has_answered = participant["answered"].get<bool>();
    row.unheard += !has_answered;
    row.different += has_answered && !participant["equal"].get<bool>();
  }
  return row;
}

// Clients of this user on this machine find codes by port: the proxy's is another way to the same.
void lend_codes(const fs::path& runtime, const std::string& from, const std::string& to) {
  fs::copy_file(runtime / "trocar" / (from + ".json"), runtime / "trocar" / (to + ".json"),
                fs::copy_options::overwrite_existing);
}

Row run(const Options& options, const Condition& condition, bool has_datagrams) {
  static const Arguments kHands{"lift",    "press", "stroke",  "slices",
                                "palpate", "tug",   "spatula", "probe"};
  const fs::path folder = fs::absolute(options.out) / "runs" /
                          (std::regex_replace(condition.name, std::regex("[^a-z0-9]+"), "-") +
                           (has_datagrams ? "-datagrams" : "-stream"));
  fs::remove_all(folder);
  fs::create_directories(folder);
  fs::permissions(folder, fs::perms::owner_all);
  setenv("XDG_STATE_HOME", (folder / "state").c_str(), 1);
  setenv("XDG_RUNTIME_DIR", folder.c_str(), 1);

  Program server(
      "trocar-server",
      {"--organ", options.organ, "--listen", "127.0.0.1:0", "--journal", "none", "--seconds",
       number(options.seconds), "--summary", (folder / "server.json").string(), "--ready-file",
       (folder / "port").string(), "--log-level", "warn"},
      folder / "server.log");
  const auto port = wait_for_port(folder / "port");
  Arguments impair{"--listen",     "127.0.0.1:0",
                   "--to",         "127.0.0.1:" + port,
                   "--ready-file", (folder / "way").string(),
                   "--delay",      number(condition.round_trip_ms / 2),
                   "--loss",       number(condition.loss_percent),
                   "--summary",    (folder / "network.json").string()};
  impair.insert(impair.end(), condition.impair.begin(), condition.impair.end());
  Program network("trocar-impair", impair, folder / "network.log");
  const auto way = wait_for_port(folder / "way");
  lend_codes(folder, port, way);
  std::vector<Program> clients;
  for (int i = 0; i < condition.hands; ++i) {
    const auto& kind = kHands[static_cast<std::size_t>(i)];
    Arguments arguments{"--server",
                        "127.0.0.1:" + way,
                        "--name",
                        kind,
                        "--no-render",
                        "--role",
                        i % 2 == 0 ? "surgeon" : "assistant",
                        "--script",
                        TROCAR_SOURCE_DIR "/deploy/scenes/" + kind + ".toml",
                        "--summary",
                        (folder / (kind + ".json")).string()};
    if (!has_datagrams) arguments.push_back("--no-datagrams");
    clients.emplace_back("trocar-client", arguments, folder / (kind + ".log"));
  }
  const int ended = server.wait(20 * options.seconds + kStartSeconds);
  std::vector<Json> summaries;
  for (auto& client : clients) client.wait(20);
  network.signal(SIGTERM);
  network.wait(5);
  for (int i = 0; i < condition.hands; ++i) {
    auto summary =
        Json::parse(testing::load_text(folder / (kHands[static_cast<std::size_t>(i)] + ".json")),
                    nullptr, false);
    if (!summary.is_discarded()) summaries.push_back(std::move(summary));
  }
  const auto server_summary =
      Json::parse(testing::load_text(folder / "server.json"), nullptr, false);
  if (ended != 0 || server_summary.is_discarded() || summaries.empty()) {
    std::fprintf(stderr, "%s: %s: the session failed, see %s\n", kProgram, condition.name.c_str(),
                 folder.c_str());
    return {.condition = condition, .has_datagrams = has_datagrams, .unheard = condition.hands};
  }
  auto row = summarise(condition, has_datagrams, server_summary, summaries);
  const auto known = server_summary["participants"].size();
  row.unheard += condition.hands - static_cast<int>(known);
  return row;
}

void write_csv(const fs::path& file, const std::vector<Row>& rows) {
  std::ofstream out(file);
  out << "network,round_trip_ms,loss_percent,path,age_median_ms,age_p99_ms,worst_age_p99_ms,"
         "hand_median_ms,hand_p99_ms,cut_median_ms,cut_p99_ms,frames_per_s,down_kbit_s,"
         "replicas_different,replicas_unheard\n";
  for (const auto& row : rows)
    out << '"' << row.condition.name << "\"," << row.condition.round_trip_ms << ','
        << row.condition.loss_percent << ',' << (row.has_datagrams ? "datagrams" : "stream") << ','
        << row.age.median << ',' << row.age.p99 << ',' << row.worst_age << ',' << row.hand.median
        << ',' << row.hand.p99 << ',' << row.cut.median << ',' << row.cut.p99 << ','
        << row.frames_per_s << ',' << row.down_kbit << ',' << row.different << ',' << row.unheard
        << '\n';
}

void write_markdown(const fs::path& file, const std::vector<Row>& rows) {
  std::ofstream out(file);
  char line[320];
  out << "| network | path | age, median (ms) | 99th | worst client's 99th | hand, median (ms) | "
         "99th | cut, median (ms) | 99th | frames/s | kbit/s | replicas not heard in the end |\n"
         "|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n";
  for (const auto& row : rows) {
    std::snprintf(
        line, sizeof line,
        "| %s | %s | %.0f | %.0f | %.0f | %.0f | %.0f | %.0f | %.0f | %.0f | %.0f | %d |\n",
        row.condition.name.c_str(), row.has_datagrams ? "datagrams" : "stream", row.age.median,
        row.age.p99, row.worst_age, row.hand.median, row.hand.p99, row.cut.median, row.cut.p99,
        row.frames_per_s, row.down_kbit, row.unheard);
    out << line;
  }
}

// One plot for each round trip: the 99th percentile over the loss, both paths.
Status write_plots(const fs::path& folder, const std::vector<Row>& rows) {
  std::map<double, std::array<plot::Series, 2>> by_trip;
  for (const auto& row : rows) {
    if (!row.condition.impair.empty() || row.age.p99 == 0) continue;
    auto& series = by_trip[row.condition.round_trip_ms][row.has_datagrams ? 0 : 1];
    series.name = row.has_datagrams ? "datagrams" : "stream alone";
    series.style = plot::Style::LineAndPoints;
    series.x.push_back(row.condition.loss_percent);
    series.y.push_back(row.age.p99);
  }
  for (const auto& [trip, series] : by_trip) {
    plot::Plot plot{
        .title = "Round trip " + number(trip) + " ms",
        .x = {.label = "loss (%)"},
        .y = {.label = "age of the surface, 99th percentile (ms)", .is_logarithmic = true},
        .series = {series[0], series[1]}};
    if (const auto done = plot::write_svg(folder / ("age-" + number(trip) + "ms.svg"), plot); !done)
      return done;
  }
  return {};
}

bool is_kept(const Row& row) {
  if (row.different > 0) return false;
  const bool is_asked =
      row.has_datagrams && row.condition.impair.empty() && row.condition.loss_percent <= 5;
  if (!is_asked) return true;
  return row.unheard == 0 && row.age.p99 <= row.condition.round_trip_ms / 2 + kFramesMs + kMarginMs;
}

int run_all(const Options& options) {
  fs::create_directories(options.out);
  std::vector<Row> rows;
  int missed = 0;
  for (const auto& condition : conditions(options.is_short)) {
    if (!std::regex_search(condition.name, std::regex(options.only))) continue;
    for (const bool has_datagrams : {true, false}) {
      rows.push_back(run(options, condition, has_datagrams));
      const auto& row = rows.back();
      std::printf(
          "%-28s %-9s age %4.0f %4.0f ms (worst %4.0f), hand %4.0f %4.0f, cut %4.0f %4.0f, "
          "%2.0f frames/s, %4.0f kbit/s, %d different, %d not heard%s\n",
          condition.name.c_str(), has_datagrams ? "datagrams" : "stream", row.age.median,
          row.age.p99, row.worst_age, row.hand.median, row.hand.p99, row.cut.median, row.cut.p99,
          row.frames_per_s, row.down_kbit, row.different, row.unheard,
          is_kept(row) ? "" : ", MISSED");
      std::fflush(stdout);
      if (!is_kept(row)) ++missed;
    }
  }
  write_csv(fs::path(options.out) / "network.csv", rows);
  write_markdown(fs::path(options.out) / "network.md", rows);
  if (const auto plotted = write_plots(options.out, rows); !plotted)
    std::fprintf(stderr, "%s: %s\n", kProgram, plotted.error().message.c_str());
  std::printf("%d of %zu rows missed what was asked for\n", missed, rows.size());
  return missed == 0 ? 0 : 1;
}

}  // namespace
}  // namespace trocar

int main(int argc, char** argv) {
  trocar::Options options;
  CLI::App app{"How old the picture is, over networks from good to bad, with the real programs."};
  app.add_option("--out", options.out, "folder of tables, plots and logs")->capture_default_str();
  app.add_option("--only", options.only, "networks whose name matches")->capture_default_str();
  app.add_option("--organ", options.organ, "built-in organ or file")->capture_default_str();
  app.add_option("--seconds", options.seconds, "simulated, of each session")
      ->check(CLI::Range(5.0, 3600.0))
      ->capture_default_str();
  app.add_flag("--short", options.is_short, "two networks of 60 ms only");
  CLI11_PARSE(app, argc, argv);
  return trocar::run_all(options);
}
