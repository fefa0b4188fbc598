// This measures what a hand feels over a network, with the real programs: a server with the
// measured liver, trocar-impair, and a client whose calculated hand presses, palpates and taps. The
// same motion is then given to a second liver without any delay, whose force is the truth.
//
// The hand is in the loop: its mass is moved by the force that it feels. So a scheme that feeds it
// shows here as error, as work done on it, or as a swing that does not end.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <numbers>
#include <optional>
#include <sstream>
#include <thread>

#include "common/journal/session_journal.h"
#include "common/math/box.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/tissue/contact/proxies.h"
#include "server/tissue/step/simulation.h"
#include "tests/support/child_program.h"

namespace trocar {
namespace {

namespace fs = std::filesystem;
using testing::Program;

constexpr const char* kProgram = "bench_feel";
constexpr double kTwoPi = 2 * std::numbers::pi;
constexpr double kBefore_m = 0.03;  // where a client's device begins, in front of the organ
constexpr double kOut_m = 0.006;    // a hand farther out than this is between two motions

struct Condition {
  double round_trip_ms = 0, loss_percent = 1;
  bool has_datagrams = true;
};

struct Motion {
  const char* name;
  double hz;       // 0: goes in and stays
  double seconds;  // in the tissue
  double middle_m, swing_m;
};
constexpr Motion kMotions[] = {{"press", 0, 2.5, 0.006, 0},
                               {"0.5 Hz", 0.5, 6, 0.005, 0.002},
                               {"1 Hz", 1, 5, 0.005, 0.002},
                               {"3 Hz", 3, 3, 0.005, 0.002}};

struct Row {
  Vec3f tip, force, server;
};

struct Felt {
  double rms_percent = 0, steady_percent = 0;  // of the greatest true force; of the true force
  double gain = 0, phase_deg = 0;              // at the motion's frequency, felt over true
  double work_mj = 0, true_work_mj = 0;        // on the hand, per cycle
  double step_n = 0, true_step_n = 0;          // the greatest within a millisecond
};

// Key frames for the hand: it waits, then goes through all motions with rests before and between.
std::string path_of(double contact_m) {
  std::ostringstream text;
  double t = 0;
  const auto add = [&](double depth) {
    text << t << " 0 0 " << -1e3 * (contact_m + depth) << '\n';
  };
  text << "0 0 0 0\n";
  t = 2;
  text << "2 0 0 0\n";
  t = 3;
  add(-0.010);
  for (const auto& motion : kMotions) {
    t += 1;
    add(-0.010);
    t += 0.5;
    const double start = t;
    for (; t < start + motion.seconds; t += 0.01)
      add(motion.middle_m + motion.swing_m * std::sin(kTwoPi * motion.hz * (t - start)));
    t += 0.5;
    add(-0.010);
  }
  t += 1;
  add(-0.010);
  return text.str();
}
double seconds_of_path() {
  double seconds = 5.5;
  for (const auto& motion : kMotions) seconds += motion.seconds + 2;
  return seconds;
}

// A liver whose tool is exactly where it is said to be in each tick.
class Truth {
 public:
  Truth(const organ::Organ& organ, const Vec3f& tip) : simulation_(organ), tip_(tip) {
    hands::TickInputs inputs;
    inputs.joins.push_back({.slot = {0}});
    tick(tip, inputs);
  }

  Vec3f force_at(const Vec3f& tip) {
    hands::TickInputs inputs;
    return tick(tip, inputs);
  }

 private:
  // The tool goes a tenth of the way in a tick: it is sent as much too far.
  Vec3f tick(const Vec3f& tip, hands::TickInputs& inputs) {
    const Vec3f target = tip_ + (tip - tip_) * static_cast<float>(hands::kPoseTicks);
    inputs.samples.push_back({tool_slot({0}, 0), {{target, {}}, tool::Verb::Push}});
    tip_ = tip;
    simulation_.tick(inputs, {});
    const auto& found = simulation_.context().contact.found;
    for (const auto& tool : found.tools)
      return contact::reaction_on(found, tool, simulation_.state().world).force_n;
    return {};
  }

  step::Simulation simulation_;
  Vec3f tip_;
};

// How far in front of its start a device meets the organ.
double contact_way(const organ::Organ& organ, const Vec3f& start) {
  Truth truth(organ, start);
  for (int i = 1; i < 2000; ++i) {
    const auto way = 1e-4f * static_cast<float>(i);
    if (length(truth.force_at(start - Vec3f{0, 0, way})) > 0.002f) return way;
  }
  return 0;
}

std::vector<Row> read_trace(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  std::vector<Row> rows;
  double first_us = -1;
  while (std::getline(in, line)) {
    std::ranges::replace(line, ',', ' ');
    std::istringstream numbers(line);
    double tool = 0, us = 0;
    Row row;
    numbers >> tool >> us >> row.tip.x >> row.tip.y >> row.tip.z >> row.force.x >> row.force.y >>
        row.force.z >> row.server.x >> row.server.y >> row.server.z;
    if (first_us < 0) first_us = us;
    // A step that was left out is filled with the one before.
    const auto index = static_cast<std::size_t>((us - first_us) * 1e-3 + 0.5);
    while (rows.size() < index) rows.push_back(rows.back());
    if (rows.size() == index) rows.push_back(row);
  }
  return rows;
}

// Returns the share of the session's ticks in which the server had time for all detail; NaN if the
// recording cannot be read.
double full_detail_percent(const fs::path& file) {
  const auto journal = journal::SessionJournal::open(file.string());
  if (!journal) return std::numeric_limits<double>::quiet_NaN();
  std::string full, now;
  double ticks = 0, full_ticks = 0;
  const auto visit = [&](Tick, const proto::TickRecord& record) {
    if (record.has_decisions()) now = record.decisions().SerializeAsString();
    if (full.empty()) full = now;
    ++ticks;
    full_ticks += now == full;
    return true;
  };
  const auto read = (*journal)->read_tick_records(0, std::numeric_limits<Tick>::max(), visit);
  return read ? 100 * full_ticks / ticks : std::numeric_limits<double>::quiet_NaN();
}

std::complex<double> at_frequency(std::span<const double> values, double hz) {
  std::complex<double> sum;
  for (std::size_t i = 0; i < values.size(); ++i)
    sum += values[i] * std::polar(1.0, -kTwoPi * hz * 1e-3 * static_cast<double>(i));
  return sum;
}

Felt compare(const Motion& motion, std::span<const Row> rows, std::span<const Vec3f> truth) {
  Felt felt;
  double squares = 0, peak = 0;
  std::vector<double> z, true_z;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double error = length(rows[i].force - truth[i]);
    squares += error * error;
    peak = std::max(peak, static_cast<double>(length(truth[i])));
    z.push_back(rows[i].force.z);
    true_z.push_back(truth[i].z);
    if (i == 0) continue;
    felt.step_n =
        std::max(felt.step_n, static_cast<double>(length(rows[i].force - rows[i - 1].force)));
    felt.true_step_n =
        std::max(felt.true_step_n, static_cast<double>(length(truth[i] - truth[i - 1])));
  }
  felt.rms_percent = 100 * std::sqrt(squares / static_cast<double>(rows.size())) / peak;
  if (motion.hz == 0) {
    // The last half second before the hand goes out.
    const std::size_t end = rows.size() - std::min<std::size_t>(rows.size(), 700);
    double sum = 0, true_sum = 0;
    for (std::size_t i = end - std::min<std::size_t>(end, 500); i < end; ++i)
      sum += z[i], true_sum += true_z[i];
    felt.steady_percent = 100 * (sum / true_sum - 1);
    return felt;
  }
  // Whole cycles after the first.
  const double period = 1000 / motion.hz;
  const auto begin = static_cast<std::size_t>(500 + period);
  const double cycles = std::floor((1000 * motion.seconds - period) / period);
  const auto count = static_cast<std::size_t>(std::lround(cycles * period));
  if (begin + count > z.size()) return felt;
  const auto ratio = at_frequency(std::span(z).subspan(begin, count), motion.hz) /
                     at_frequency(std::span(true_z).subspan(begin, count), motion.hz);
  felt.gain = std::abs(ratio);
  felt.phase_deg = std::arg(ratio) * 360 / kTwoPi;
  for (std::size_t i = begin; i < begin + count; ++i) {
    const Vec3f way = rows[i].tip - rows[i - 1].tip;
    felt.work_mj += 1e3 * dot(rows[i - 1].force, way) / cycles;
    felt.true_work_mj += 1e3 * dot(truth[i - 1], way) / cycles;
  }
  return felt;
}

std::optional<std::string> read_line(const fs::path& file) {
  for (int i = 0; i < 1200; ++i) {
    std::ifstream in(file);
    std::string line;
    if (std::getline(in, line) && !line.empty()) return line;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return std::nullopt;
}

std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::optional<std::vector<Row>> run(const Condition& condition, const std::string& organ,
                                    const fs::path& folder, double contact_m) {
  fs::remove_all(folder);
  fs::create_directories(folder);
  fs::permissions(folder, fs::perms::owner_all);
  setenv("XDG_STATE_HOME", (folder / "state").c_str(), 1);
  setenv("XDG_RUNTIME_DIR", folder.c_str(), 1);
  std::ofstream(folder / "path.txt") << path_of(contact_m);
  Program server("trocar-server",
                 {"--organ", organ, "--listen", "127.0.0.1:0", "--journal",
                  (folder / "session.mcap").string(), "--ready-file", (folder / "port").string()},
                 folder / "server.log");
  const auto port = read_line(folder / "port");
  if (!port) return std::nullopt;
  Program network("trocar-impair",
                  {"--listen", "127.0.0.1:0", "--to", "127.0.0.1:" + *port, "--delay",
                   number(condition.round_trip_ms / 2), "--loss", number(condition.loss_percent),
                   "--ready-file", (folder / "way").string()},
                  folder / "network.log");
  const auto way = read_line(folder / "way");
  if (!way) return std::nullopt;
  // The link file that the client joins with is found by port: it is that of the way there, too.
  fs::copy_file(folder / "trocar" / (*port + ".json"), folder / "trocar" / (*way + ".json"));
  std::vector<std::string> arguments{"--server",
                                     "127.0.0.1:" + *way,
                                     "--no-render",
                                     "--name",
                                     "hand",
                                     "--device",
                                     "simulated:path=" + (folder / "path.txt").string(),
                                     "--seconds",
                                     number(seconds_of_path()),
                                     "--hand-trace",
                                     (folder / "trace.csv").string(),
                                     "--summary",
                                     (folder / "hand.json").string()};
  if (!condition.has_datagrams) arguments.push_back("--no-datagrams");
  Program client("trocar-client", arguments, folder / "client.log");
  if (client.wait(seconds_of_path() + 60) != 0) return std::nullopt;
  return read_trace(folder / "trace.csv");
}

void print(const Condition& condition, const organ::Organ& organ, std::span<const Row> rows,
           double contact_z, const fs::path& folder) {
  Truth truth(organ, rows.front().tip);
  std::vector<Vec3f> forces;
  double free_n = 0;
  std::ofstream curves(folder / "curves.csv");
  const double detail_percent = full_detail_percent(folder / "session.mcap");
  curves << "time_s,depth_m,felt_n,true_n,server_n\n";
  for (const auto& row : rows) {
    forces.push_back(truth.force_at(row.tip));
    curves << 1e-3 * static_cast<double>(forces.size()) << ',' << contact_z - row.tip.z << ','
           << row.force.z << ',' << forces.back().z << ',' << row.server.z << '\n';
    if (row.tip.z > contact_z + kOut_m)
      free_n = std::max(free_n, static_cast<double>(length(row.force)));
  }
  std::size_t i = 0;
  for (const auto& motion : kMotions) {
    const auto is_in = [&](std::size_t k) { return rows[k].tip.z < contact_z + kOut_m; };
    while (i < rows.size() && !is_in(i)) ++i;
    std::size_t end = i;
    while (end < rows.size() && is_in(end)) ++end;
    if (end - i < 1000) return;
    const auto felt = compare(motion, rows.subspan(i, end - i),
                              std::span<const Vec3f>(forces).subspan(i, end - i));
    std::printf(
        "| %g | %g | %s | %s | %.1f | %.2f | %.3f | %.1f | %.2f | %.2f | %.3f | %.3f | %.3f | %.0f "
        "|\n",
        condition.round_trip_ms, condition.loss_percent,
        condition.has_datagrams ? "datagrams" : "stream", motion.name, felt.rms_percent,
        felt.steady_percent, felt.gain, felt.phase_deg, felt.work_mj, felt.true_work_mj,
        felt.step_n, felt.true_step_n, free_n, detail_percent);
    i = end;
  }
  std::fflush(stdout);
}

}  // namespace
}  // namespace trocar

int main(int argc, char** argv) {
  using namespace trocar;
  std::string out = "out/feel", organ_name = "liver";
  bool is_short = false;
  CLI::App app("Compares what a hand feels over a network with tissue that answers at once.",
               kProgram);
  app.add_option("--out", out, "where traces and logs go")->capture_default_str();
  app.add_option("--organ", organ_name, "as trocar-server's")->capture_default_str();
  app.add_flag("--short", is_short, "two networks");
  Condition own;
  auto* trip = app.add_option("--round-trip", own.round_trip_ms, "this network alone, ms");
  app.add_option("--loss", own.loss_percent, "of it, percent")->needs(trip);
  CLI11_PARSE(app, argc, argv);
  const auto organ = organ::Organ(*catalogue::load_organ(organ_name));
  Box<float> box;
  for (const auto& place : organ.mesh.rest_positions) box.include(to_float(place));
  Vec3f start = (box.least + box.most) * 0.5f;
  start.z = box.most.z + static_cast<float>(kBefore_m);
  const double contact_m = contact_way(organ, start);
  std::vector<Condition> conditions{{0, 0}, {100, 1}};
  if (!is_short)
    conditions = {{0, 1}, {20, 1}, {50, 1}, {100, 1}, {100, 0}, {100, 5}, {150, 1}, {50, 1, false}};
  if (trip->count() > 0) conditions = {own};
  std::printf(
      "| round trip (ms) | lost (%%) | path | motion | rms (%%) | steady (%%) | gain | phase (deg) "
      "| "
      "work (mJ) | true | step (N/ms) | true | free (N) "
      "| full detail (%%) |\n|--:|--:|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  for (const auto& condition : conditions) {
    const auto rows = run(condition, organ_name, fs::absolute(out), contact_m);
    if (!rows || rows->empty()) {
      std::fprintf(stderr, "%s: a program failed, see %s\n", kProgram, out.c_str());
      return 1;
    }
    print(condition, organ, *rows, static_cast<double>(start.z) - contact_m, out);
  }
  return 0;
}
