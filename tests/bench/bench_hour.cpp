// This program plays a long session without a network: two blades cut an organ, stroke after
// stroke, while a grasper draws the wounds open; now and then the tools rest, and the organ goes
// back to how it was at first. Once a minute it prints what a tick, a frame and the recording take
// by then. In the end it verifies the recording, jumps about in it, and says how much somebody who
// joins late gets. Decisions are fixed, so that the hash can be repeated.

#include <CLI/CLI.hpp>
#include <array>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "client/replay/replay_source.h"
#include "client/replica/replica.h"
#include "common/base/log.h"
#include "common/base/program.h"
#include "common/base/timing.h"
#include "common/math/box.h"
#include "server/app/server/simulation_loop.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/session/recording/verify.h"
#include "server/session/replication/frame_encoder.h"
#include "server/session/replication/messages.h"
#include "tests/bench/resident_memory.h"

namespace trocar {
namespace {

constexpr const char* kProgram = "bench_hour";
constexpr Tick kMinute = 60'000;
constexpr Tick kStroke = 3000, kStrokeCuts = 800;  // ticks, and those in which the blade cuts
// Ticks after a stroke's beginning: the blade is out, and above the next place; the grasper grasps,
// and lets go.
constexpr Tick kLifted = 1200, kCarried = 2600, kGrasps = 1600, kLetsGo = 2700;
constexpr float kLift_m = 0.08f;
constexpr float kStrokeSpeed_m_s = 0.05f;
constexpr int kHands = 3, kRetractor = 2;
constexpr int kSeeks = 20;

constexpr Tick kStep = 4;       // ticks from one place of a hand to its next
constexpr Tick kRest = 20'000;  // ticks at the end of a minute with a rest
constexpr float kLeastSpread = 0.05f;

struct Options {
  std::string organ = "liver", journal = "out/bench-hour.mcap";
  int minutes = 60;
  double stroke_s = 3;     // from one stroke of a blade to its next
  float spread = 0.7f;     // of the organ's size, where strokes begin
  int rest_minutes = 0;    // every so many there is a rest; 0: never
  int return_minutes = 0;  // likewise, the organ goes back
};

template <typename T>
T must(Result<T> result) {
  if (result) return std::move(*result);
  std::fprintf(stderr, "%s: %s\n", kProgram, result.error().message.c_str());
  std::exit(static_cast<int>(ExitCode::BadFile));
}

// Hands move as a function of the tick and of where the surface is, and nowhere faster than hands
// do.
class Hands {
 public:
  Hands(const step::Simulation& simulation, const Options& options)
      : simulation_(simulation),
        spread_(options.spread),
        period_(2 * kStep * static_cast<Tick>(std::lround(125 * options.stroke_s))) {
    for (const auto& p : simulation.organ().mesh.rest_positions) box_.include(to_float(p));
  }

  static hands::HandJoin join_of(int hand) {
    hands::HandJoin join{.slot = {static_cast<std::uint8_t>(hand)}};
    join.shapes[0] = hand == kRetractor ? tool::ToolShape{}
                                        : tool::ToolShape{.radius_m = 0.001f, .edge_m = 0.04f};
    return join;
  }

  // Until then tools that are lifted stay where they are.
  void rest_until(Tick tick) { rest_until_ = tick; }

  // Blades go by turns of half a stroke; the grasper draws at where the first blade has cut.
  void move(Tick tick, participants::SimulationInbox& inbox) {
    if (tick % kStep != 0) return;
    for (int hand = 0; hand < kHands; ++hand) {
      const Tick turn = hand < kRetractor ? static_cast<Tick>(hand) * period_ / 2 : 0;
      auto& clock = clocks_[static_cast<std::size_t>(hand)];
      if (tick == 0) clock = turn;
      const Tick since = since_begin(clock);
      if (hand == kRetractor)
        draw(clock / period_, since, inbox);
      else
        cut(hand, static_cast<std::uint32_t>(2 * (clock / period_)) + static_cast<unsigned>(hand),
            since, inbox);
      const bool rests = since == kLifted && rest_until_ > 0 && tick < rest_until_ + turn;
      if (!rests) clock += kStep;
    }
  }

 private:
  // Ticks since a stroke's beginning, without the time that the tools wait, lifted, for the next
  // one.
  Tick since_begin(Tick tick) const {
    const Tick since = tick % period_, pause = period_ - kStroke;
    return since < kLifted ? since : since - std::min(pause, since - kLifted);
  }
  // The blade cuts, is lifted out, is carried over, and goes in by cutting at the next place.
  void cut(int hand, std::uint32_t stroke, Tick since, participants::SimulationInbox& inbox) {
    const auto along = [](std::uint32_t s, Tick ticks) {
      const float angle = 2.39996f * static_cast<float>(s);
      return Vec3f{std::cos(angle), 0, std::sin(angle)} *
             (kStrokeSpeed_m_s * static_cast<float>(ticks) * 1e-3f - 0.02f);
    };
    const Vec3f end = place_of(stroke) + along(stroke, kStrokeCuts),
                next = place_of(stroke + 2) + along(stroke + 2, 0);
    const auto share = [since](Tick from, Tick to) {
      return std::clamp(
          (static_cast<float>(since) - static_cast<float>(from)) / static_cast<float>(to - from),
          0.0f, 1.0f);
    };
    Vec3f tip = since < kStrokeCuts ? place_of(stroke) + along(stroke, since)
                                    : end + (next - end) * share(kLifted, kCarried);
    tip.y += kLift_m * (share(kStrokeCuts, kLifted) - share(kCarried, kStroke));
    put(inbox, hand, tip,
        since < kStrokeCuts || since >= kCarried ? tool::Verb::Cut : tool::Verb::None);
  }
  Vec3f place_of(std::uint32_t stroke) const {
    const float a = std::fmod(static_cast<float>(stroke) * 0.618034f, 1.0f),
                b = std::fmod(static_cast<float>(stroke) * 0.754877f, 1.0f);
    const Vec3f size = box_.most - box_.least;
    return box_.least + Vec3f{size.x * (0.5f + spread_ * (a - 0.5f)), 0.6f * size.y,
                              size.z * (0.5f + spread_ * (b - 0.5f))};
  }
  // When the blade is out, the grasper comes down to the nearest surface, lifts it by 15 mm and
  // lets it down again. While the blade cuts, it is carried to above the next place.
  void draw(Tick strokes, Tick since, participants::SimulationInbox& inbox) {
    const auto stroke = static_cast<std::uint32_t>(2 * strokes);
    const Vec3f above{0, kLift_m, 0};
    if (since < kLifted) {
      const Vec3f next = nearest_above(place_of(stroke)) + above;
      if (since == 0) left_ = strokes == 0 ? next : grasped_ + above;
      return put(inbox, kRetractor, left_ + (next - left_) * (static_cast<float>(since) / kLifted),
                 tool::Verb::None);
    }
    if (since < kLifted + kStep) grasped_ = nearest_above(place_of(stroke));
    const auto part = [since](Tick from, Tick to) {
      return std::clamp(
          (static_cast<float>(since) - static_cast<float>(from)) / static_cast<float>(to - from),
          0.0f, 1.0f);
    };
    const bool grasps = since >= kGrasps && since < kLetsGo;
    const float height = kLift_m * (1 - part(kLifted, kGrasps) + part(kLetsGo, kStroke)) +
                         0.015f * std::sin(static_cast<float>(M_PI) * part(kGrasps, kLetsGo));
    put(inbox, kRetractor, grasped_ + Vec3f{0, height, 0},
        grasps ? tool::Verb::Grasp : tool::Verb::None);
  }
  Vec3f nearest_above(const Vec3f& place) const {
    const auto& world = simulation_.state().world;
    Vec3f best = place;
    float least = INFINITY;
    for (const auto node : world.surface_nodes) {
      const Vec3f p = world.position(node);
      const float squared = length_squared(p - (place + Vec3f{0, 0.05f, 0}));
      if (squared < least) least = squared, best = p;
    }
    return best;
  }
  static void put(participants::SimulationInbox& inbox, int hand, const Vec3f& tip,
                  tool::Verb verb) {
    inbox.push_sample({tool_slot({static_cast<std::uint8_t>(hand)}, 0),
                       {{tip, rotation_from_z({0, 1, 0})}, verb}});
  }

  const step::Simulation& simulation_;
  const float spread_;
  const Tick period_;
  std::array<Tick, kHands> clocks_{};  // of each hand, which stands still while it rests
  Tick rest_until_ = 0;
  Box<float> box_;
  Vec3f grasped_, left_;
};

// Frames go to clients that keep up.
class Wire {
 public:
  void take(const std::vector<step::SharedFrame>& frames) {
    for (const auto& frame : frames) {
      const auto before = encoder_.current();
      encoder_.set_current(frame, 0);
      ++frames_;
      // A surface that has gone back to an earlier one is sent whole.
      const bool follows = before && before->surface.size() <= frame->surface.size();
      if (before)
        bytes_ += (follows ? encoder_.delta_from(*before) : encoder_.keyframe())->size() +
                  encoder_.state()->size();
    }
  }
  double bytes_per_frame() {
    const double mean =
        frames_ > 0 ? static_cast<double>(bytes_) / static_cast<double>(frames_) : 0;
    frames_ = bytes_ = 0;
    return mean;
  }
  // Returns what somebody who joins now is sent before the first delta.
  std::size_t join_bytes(const step::Simulation& simulation) {
    return replication::encode_topology(simulation.layout(), simulation.organ().name)->size() +
           encoder_.keyframe()->size();
  }

 private:
  replication::FrameEncoder encoder_;
  std::uint64_t frames_ = 0, bytes_ = 0;
};

void print_minute(int minute, const app::LoopReport& report, const step::Simulation& simulation,
                  Wire& wire, double journal_mb) {
  const auto& tick = report.times.tick;
  const auto stage = [&](step::Stage s) {
    return report.times.stages[static_cast<std::size_t>(s)].quantile_us(0.5);
  };
  const auto& topology = simulation.state().cuts.topology();
  std::printf(
      "| %6d | %6zu | %6zu | %5.0f | %5.0f | %6.0f | %5.0f | %5.0f | %5.0f | %5.0f | %6.2f |\n",
      minute, topology.tet_count(), simulation.layout().vertex_count(), tick.quantile_us(0.5),
      tick.quantile_us(0.99), tick.quantile_us(1), stage(step::Stage::Contacts),
      stage(step::Stage::Solve), bench::resident_mb(), wire.bytes_per_frame(), journal_mb);
  std::fflush(stdout);
}

// Returns whether the recording is verified.
bool verify(const Options& options) {
  const auto begin = thread_cpu_ns();
  const auto report = must(recording::verify_journal(options.journal));
  const double seconds = static_cast<double>(thread_cpu_ns() - begin) * 1e-9;
  std::printf("verify: %s, %" PRIu64 " ticks in %.1f s of CPU time: %.2f times real time %s\n",
              recording::name_of(report.verdict()), report.ticks_verified, seconds,
              static_cast<double>(report.ticks_verified) * 1e-3 / seconds, report.why().c_str());
  return report.verdict() == recording::Verdict::Verified;
}

void seek(const Options& options) {
  auto source = must(replay::ReplaySource::open(options.journal));
  replica::Replica replica([](const proto::Envelope&) { return true; });
  source->poll(replica);
  source->pause();
  std::vector<double> ms;
  std::uint32_t random = 1;
  for (int i = 0; i < kSeeks; ++i) {
    random = random * 1664525u + 1013904223u;
    const auto begin = thread_cpu_ns();
    source->seek(random % static_cast<std::uint32_t>(source->last_tick()));
    source->poll(replica);
    ms.push_back(static_cast<double>(thread_cpu_ns() - begin) * 1e-6);
  }
  std::ranges::sort(ms);
  std::printf("%d seeks: median %.1f ms, worst %.1f ms of CPU time; replica %s\n", kSeeks,
              ms[ms.size() / 2], ms.back(),
              replica.fault().ok() ? "in step" : replica.fault().error().message.c_str());
}

void play(const Options& options) {
  const auto organ = must(catalogue::load_organ(options.organ));
  step::Simulation simulation(organ);
  const auto folder = std::filesystem::path(options.journal).parent_path();
  if (!folder.empty()) std::filesystem::create_directories(folder);
  const auto journal = must(app::open_journal(options.journal, organ, simulation.layout()));
  participants::SimulationInbox inbox;
  app::FrameHandover handover([] {});
  std::vector<participants::Participant> present;
  for (int hand = 0; hand < kHands; ++hand) {
    const auto join = Hands::join_of(hand);
    if (!inbox.try_push_join(join)) std::abort();
    present.push_back(
        {join.slot, "hand " + std::to_string(hand + 1), wire::Role::Surgeon, {join.shapes[0]}});
  }
  journal->record_participants(present, 0);
  Hands hands(simulation, options);
  Wire wire;
  std::vector<step::SharedFrame> frames;
  const auto decisions = simulation.with_sweeps_for_organ({});
  double recorded_mb = 0;
  std::printf("%s, two blades and a grasper; times are thread CPU time, us\n\n",
              organ.name.c_str());
  std::printf(
      "| minute | tets | surface vertices | tick | 99th | worst | contacts | solve | memory "
      "(MB) | bytes a frame | recorded (MB) |\n"
      "|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  const auto is_due = [](int minute, int period) { return period > 0 && minute % period == 0; };
  inbox.push_mark(hands::MarkAction::Set);
  for (int minute = 1; minute <= options.minutes; ++minute) {
    const Tick end = static_cast<Tick>(minute) * kMinute;
    if (minute > 1 && is_due(minute - 1, options.return_minutes))
      inbox.push_mark(hands::MarkAction::Return);
    app::SimulationLoop loop(simulation, inbox, handover, journal.get(),
                             {.decisions = decisions, .rate = {}, .tick_count = end}, [] {});
    do {
      const Tick now = simulation.current_tick();
      if (is_due(minute, options.rest_minutes) && now + kRest == end) hands.rest_until(end);
      hands.move(now, inbox);
      handover.pop_all(frames);
      wire.take(frames);
    } while (!loop.run_tick());
    const double mb = static_cast<double>(std::filesystem::file_size(options.journal)) * 1e-6;
    print_minute(minute, loop.report(), simulation, wire, mb - recorded_mb);
    recorded_mb = mb;
  }
  std::printf("\nstate hash %016" PRIx64 "; who joins late is sent %.0f kB\n",
              simulation.state_hash(), static_cast<double>(wire.join_bytes(simulation)) * 1e-3);
  const auto closed = journal->close();
  if (!closed) std::printf("recording: %s\n", closed.error().message.c_str());
}

}  // namespace
}  // namespace trocar

int main(int argc, char** argv) {
  using namespace trocar;
  begin_program(kProgram);
  Options options;
  CLI::App app{"A long session of cutting: what a tick, a frame and the recording take", kProgram};
  app.add_option("--organ", options.organ, "as trocar-server's")->capture_default_str();
  app.add_option("--minutes", options.minutes, "simulated")
      ->check(CLI::Range(1, 600))
      ->capture_default_str();
  app.add_option("--journal", options.journal, "recording to make")->capture_default_str();
  app.add_option("--stroke", options.stroke_s, "s from one stroke of a blade to its next")
      ->check(CLI::Range(static_cast<double>(kStroke) * 1e-3, 60.0))
      ->capture_default_str();
  app.add_option("--spread", options.spread, "of the organ's size: where strokes begin")
      ->check(CLI::Range(kLeastSpread, 0.7f))
      ->capture_default_str();
  app.add_option("--rest", options.rest_minutes,
                 "every so many minutes tools rest for 20 s; 0: never")
      ->check(CLI::Range(0, 600))
      ->capture_default_str();
  app.add_option("--return", options.return_minutes,
                 "every so many minutes the organ goes back to how it was at first; 0: never")
      ->check(CLI::Range(0, 600))
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  play(options);
  const bool is_verified = verify(options);
  seek(options);
  return static_cast<int>(is_verified ? ExitCode::Ok : ExitCode::Mismatch);
}
