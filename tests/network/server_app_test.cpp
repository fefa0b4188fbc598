// The server program's parts: pacing, the simulation loop's frames and records, the command line,
// and one run of the whole program as a process.

#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <sstream>

#include "common/journal/mcap_reader.h"
#include "common/process/process.h"
#include "server/app/server/frame_handover.h"
#include "server/app/server/options.h"
#include "server/app/server/pacer.h"
#include "server/app/server/simulation_loop.h"
#include "server/session/recording/tick_records.h"
#include "tests/network/session_fixture.h"

namespace trocar::testing {
namespace {

TEST(Pacer, on_time_ticks_are_a_millisecond_apart_and_never_slow) {
  app::Pacer pacer(5'000'000);
  for (std::uint64_t i = 0; i < 1000; ++i) {
    EXPECT_EQ(pacer.due_ns(), 5'000'000 + i * kTickNanoseconds);
    pacer.begin_tick(pacer.due_ns() + 100'000);
  }
  EXPECT_EQ(pacer.slow_ticks(), 0u);
}

TEST(Pacer, after_a_stall_a_frame_is_caught_up_with_and_the_rest_is_given_up) {
  app::Pacer pacer(0);
  pacer.begin_tick(0);
  const std::uint64_t late = 50 * kTickNanoseconds;  // ticks 1 to 50 are due
  int at_once = 0;
  while (pacer.due_ns() <= late) {
    pacer.begin_tick(late);
    ++at_once;
  }
  EXPECT_EQ(at_once, 16);
  EXPECT_EQ(pacer.slow_ticks(), 34u);
  EXPECT_EQ(pacer.due_ns(), late + kTickNanoseconds);
}

TEST(Pacer, a_long_tick_that_those_after_it_make_up_for_slows_nothing) {
  app::Pacer pacer(0);
  std::uint64_t now = 0;
  for (int tick = 0; tick < 2000; ++tick) {
    now = std::max(now, pacer.due_ns());
    pacer.begin_tick(now);
    now += tick % 20 == 0 ? 7'000'000 : 600'000;
  }
  EXPECT_EQ(pacer.slow_ticks(), 0u);
  EXPECT_EQ(pacer.due_ns(), 2000 * kTickNanoseconds);
}

TEST(Pacer, a_rate_stretches_the_time_between_ticks) {
  app::Pacer pacer(0);
  pacer.begin_tick(0);
  pacer.restart(7'000'000, 0.25f);
  for (std::uint64_t i = 0; i < 100; ++i) {
    EXPECT_EQ(pacer.due_ns(), 7'000'000 + 4 * i * kTickNanoseconds);
    pacer.begin_tick(pacer.due_ns());
  }
  EXPECT_EQ(pacer.slow_ticks(), 0u) << "that is no lateness";
}

TEST(Pacer, faster_than_real_time_nothing_is_late) {
  app::Pacer pacer(0);
  pacer.restart(0, 10);
  pacer.begin_tick(0);
  EXPECT_EQ(pacer.due_ns(), kTickNanoseconds / 10);
  pacer.begin_tick(50 * kTickNanoseconds);
  EXPECT_EQ(pacer.slow_ticks(), 0u);
  EXPECT_GE(pacer.due_ns(), 48 * kTickNanoseconds) << "and little is made up for";
}

TEST(Pacer, random_stalls_keep_the_books) {
  for (unsigned seed = 0; seed < 100; ++seed) {
    std::mt19937 random(seed);
    app::Pacer pacer(0);
    std::uint64_t now = 0, ticks = 0;
    int burst = 0;
    for (int i = 0; i < 2000; ++i) {
      burst = now >= pacer.due_ns() && i > 0 ? burst : 0;
      now = std::max(now, pacer.due_ns());
      pacer.begin_tick(now);
      ++ticks;
      // Ticks and given-up ticks together are the milliseconds that have passed.
      EXPECT_EQ(pacer.due_ns(), (ticks + pacer.slow_ticks()) * kTickNanoseconds);
      EXPECT_LE(now, pacer.due_ns() + 15 * kTickNanoseconds) << "more than a frame is caught up";
      now += random() % 5 == 0 ? random() % (20 * kTickNanoseconds) : random() % 900'000;
    }
  }
}

TEST(FrameHandover, keeps_frames_that_change_the_surface_when_it_is_full) {
  app::FrameHandover handover([] {});
  std::vector<step::SharedFrame> taken;
  std::vector<Frame> changed;
  Frame number = 0;
  const auto push = [&](bool is_cut) {
    auto frame = std::make_shared<step::PublishedFrame>();
    frame->frame = ++number;
    if (is_cut) frame->change = std::make_shared<wire::SurfaceChange>();
    handover.push(frame);
  };
  for (std::size_t i = 0; i < app::FrameHandover::kCapacity + 100; ++i) push(i % 7 == 0);
  std::vector<Frame> order, cuts;
  for (int round = 0; round < 3; ++round) {
    handover.pop_all(taken);
    for (const auto& frame : taken) {
      order.push_back(frame->frame);
      if (frame->change) cuts.push_back(frame->frame);
    }
    push(false);
  }
  EXPECT_TRUE(std::ranges::is_sorted(order));
  EXPECT_EQ(cuts.size(), (app::FrameHandover::kCapacity + 100 + 6) / 7);
  EXPECT_GT(handover.dropped(), 50u);
}

TEST(DurationHistogram, quantiles_within_two_per_cent) {
  std::mt19937 random(1);
  std::vector<std::uint64_t> values;
  replication::DurationHistogram histogram;
  for (int i = 0; i < 20'000; ++i) {
    const std::uint64_t value = (1ull << random() % 30) + random() % 1000;
    values.push_back(value);
    histogram.add(value);
  }
  std::sort(values.begin(), values.end());
  for (const double share : {0.01, 0.5, 0.9, 0.99, 1.0}) {
    const auto rank = static_cast<std::size_t>(share * 20'000) - 1;
    const double exact_us = static_cast<double>(values[rank]) / 1e3;
    EXPECT_NEAR(histogram.quantile_us(share), exact_us, 0.02 * exact_us) << share;
  }
  EXPECT_EQ(replication::DurationHistogram().quantile_us(0.5), 0.0);
}

// A journal that only keeps what it was given.
struct KeepingSink final : app::JournalSink {
  void record_frame(const step::SharedFrame& frame) override { frames.push_back(frame); }
  void record_participants(const std::vector<participants::Participant>&, Tick) override {}
  void record_hand(wire::HandRecord) override {}
  void record_lesson(wire::LessonEntry) override {}
  Status close() override { return {}; }
  wire::RecordingState state() const override { return {}; }
  std::vector<step::SharedFrame> frames;
};

TEST(SimulationLoop, a_pause_stops_at_a_frame_and_changes_no_tick) {
  const auto organ = *catalogue::make_lattice({8, 5, 8, 0.01});
  std::vector<std::uint64_t> hashes;
  for (const bool pauses : {false, true}) {
    step::Simulation simulation(organ);
    participants::SimulationInbox inbox;
    std::atomic<std::size_t> frames{0};
    app::FrameHandover handover([&frames] { ++frames; });
    app::SimulationLoop loop(simulation, inbox, handover, nullptr, {.tick_count = 160}, [] {});
    if (pauses) loop.set_rate(0);
    loop.start();
    std::vector<step::SharedFrame> taken;
    if (pauses) {
      while (taken.empty()) handover.pop_all(taken);
      EXPECT_EQ(taken.back()->frame, 1u) << "there is something to see";
      // More than its queue holds arrives meanwhile, and nobody is refused.
      for (std::uint8_t round = 0; round < 200; ++round) {
        while (!inbox.try_push_join({.slot = {0}})) std::this_thread::yield();
        inbox.push_leave({0});
      }
      handover.pop_all(taken);
      EXPECT_TRUE(taken.empty());
      loop.set_rate(0.5f);
    }
    while (taken.empty() || taken.back()->tick < 160) {
      handover.pop_all(taken);
      std::this_thread::yield();
    }
    loop.stop();
    EXPECT_EQ(loop.report().ticks, 160u);
    hashes.push_back(simulation.state_hash());
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

TEST(SimulationLoop, goes_faster_only_while_hands_follow) {
  step::Simulation simulation(*catalogue::make_lattice({4, 3, 4, 0.01}));
  participants::SimulationInbox inbox;
  app::FrameHandover handover([] {});
  app::SimulationLoop loop(simulation, inbox, handover, nullptr, {.pace = 10}, [] {});
  const auto run_to = [&](Frame frame) {
    while (simulation.current_tick() < frame * kTicksPerFrame) loop.run_tick();
  };
  run_to(1);
  EXPECT_EQ(loop.rate(), 1) << "nobody has shown anything";
  loop.note_followed(1);
  EXPECT_EQ(loop.rate(), 10);
  run_to(3);
  EXPECT_EQ(loop.rate(), 10);
  loop.run_tick();
  EXPECT_EQ(loop.rate(), 1) << "frames 2 and 3 are on their way";
  loop.note_followed(2);
  EXPECT_EQ(loop.rate(), 10);
  loop.set_rate(0.5f);
  EXPECT_EQ(loop.rate(), 5);
  loop.set_rate(0);
  EXPECT_EQ(loop.rate(), 0);
  loop.note_followed(0);
  EXPECT_EQ(loop.rate(), 0);
  loop.request_stop();
  EXPECT_EQ(loop.rate(), 1) << "it ends with a frame";
}

TEST(SimulationLoop, its_records_and_snapshot_simulate_the_session_again) {
  const auto organ = *catalogue::make_lattice({8, 5, 8, 0.01});
  step::Simulation simulation(organ);
  participants::SimulationInbox inbox;
  app::FrameHandover handover([] {});
  KeepingSink sink;
  app::SimulationLoop loop(simulation, inbox, handover, &sink, {.tick_count = 500}, [] {});
  std::mt19937 random(3);
  Tick tick = 0;
  bool is_last = false;
  while (!is_last) {
    ++tick;
    ASSERT_TRUE(tick != 5 || inbox.try_push_join({{0}, 1, {}}));
    if (tick == 400) inbox.push_leave({0});
    if (tick > 5 && tick < 400) {
      hands::ToolInput input{{0}, {}};
      const auto sway = static_cast<float>(random() % 100) * 1e-5f;
      input.sample.world_from_tool = {{0.005f + sway, 0.018f, 0.005f}, rotation_from_z({0, 1, 0})};
      input.sample.verb = tool::Verb::Push;
      inbox.push_sample(input);
    }
    is_last = loop.run_tick();
  }
  EXPECT_EQ(tick, 512u) << "ends with a published frame";
  ASSERT_EQ(sink.frames.size(), 512u / kTicksPerFrame);
  ASSERT_TRUE(sink.frames[0]->snapshot);
  EXPECT_EQ(sink.frames[0]->snapshot_tick, 0u);
  EXPECT_EQ(loop.report().last_frame, sink.frames.back());
  EXPECT_GT(loop.report().max_active_nodes, 0u) << "the tool touched nothing";

  step::Simulation again(organ);
  ASSERT_TRUE(again.restore_snapshot(*sink.frames[0]->snapshot).ok());
  Tick expected = 0;
  for (const auto& frame : sink.frames) {
    ASSERT_EQ(frame->records.size(), kTicksPerFrame);
    for (const auto& record : frame->records) {
      EXPECT_EQ(record.tick, ++expected);
      ASSERT_EQ(again.tick(record.inputs, record.decisions).state_hash, record.state_hash)
          << "tick " << record.tick;
    }
    EXPECT_EQ(frame->figures.state_hash, frame->records.back().state_hash);
    EXPECT_EQ(again.pop_frame()->surface_crc, frame->surface_crc);
  }
  std::vector<step::SharedFrame> handed;
  handover.pop_all(handed);
  EXPECT_EQ(handed, sink.frames);
}

// Moves the first tool of slot 1 on a machine whose ticks take all the time there is: it is held
// back, and all of that is in the recording, which gives the same hashes again.
void expect_held_back(tool::Verb verb, const std::function<Vec3f(float seconds)>& place) {
  const auto organ = *catalogue::make_liver(1500);
  step::Simulation simulation(organ);
  participants::SimulationInbox inbox;
  app::FrameHandover handover([] {});
  KeepingSink sink;
  std::uint64_t now_ns = 0;
  app::LoopOptions options{.rate = control::RateLimits{}, .tick_count = 480};
  options.clock_ns = [&now_ns] { return now_ns += kTickNanoseconds; };
  app::SimulationLoop loop(simulation, inbox, handover, &sink, options, [] {});
  hands::HandJoin join{.slot = {1}};
  join.shapes[0] = {
      .radius_m = 0.002f, .length_m = 0.3f, .reach_m = 0.02f, .grip_n = 100, .edge_m = 0.1f};
  ASSERT_TRUE(inbox.try_push_join(join));
  for (int tick = 0; tick < 480; ++tick) {
    const Vec3f tip = place(static_cast<float>(tick) * kTickSeconds);
    inbox.push_sample({tool_slot({1}, 0), {{tip, rotation_from_z({0, 1, 0})}, verb}});
    loop.run_tick();
  }
  EXPECT_GT(loop.report().rate.waits[2], 100u);
  EXPECT_EQ(loop.report().rate.waits[0], 0u);
  EXPECT_EQ(sink.frames.back()->figures.pace.rate.waiting_tools, 4u);

  step::Simulation again(organ);
  std::uint32_t waited = 0;
  for (const auto& frame : sink.frames)
    for (const auto& record : frame->records) {
      proto::TickRecord message;
      recording::to_message(record, nullptr, message);
      step::TickRecord read;
      ASSERT_TRUE(recording::from_message(message, read).ok());
      ASSERT_EQ(read.decisions, record.decisions);
      waited |= read.decisions.waiting_tools;
      ASSERT_EQ(again.tick(read.inputs, read.decisions).state_hash, record.state_hash);
    }
  EXPECT_EQ(waited, 4u);
}

TEST(SimulationLoop, a_blade_that_is_too_fast_is_held_back_and_the_recording_knows) {
  expect_held_back(tool::Verb::Cut, [](float seconds) {
    return Vec3f{0.5f * seconds - 0.12f, 0, 0};
  });
}

TEST(SimulationLoop, a_tip_that_is_thrown_about_is_held_back_and_the_recording_knows) {
  expect_held_back(tool::Verb::Push, [](float seconds) {
    const float down = std::max(0.0f, 0.1f - 0.5f * seconds);
    return Vec3f{0.05f * std::sin(20 * seconds), down, 0};
  });
}

TEST(SimulationLoop, jaws_that_swing_tissue_are_held_back_and_the_recording_knows) {
  const auto organ = *catalogue::make_liver(1500);
  const auto top = *std::ranges::max_element(organ.mesh.rest_positions, {}, &Vec3d::y);
  expect_held_back(tool::Verb::Grasp, [at = to_float(top)](float seconds) {
    return at + Vec3f{0.02f * std::sin(20 * std::max(0.0f, seconds - 0.1f)), 0, 0};
  });
}

TEST(SimulationLoop, a_later_snapshot_restores_to_the_hashes_that_follow) {
  const auto organ = *catalogue::make_lattice({4, 3, 4, 0.01});
  step::Simulation simulation(organ);
  participants::SimulationInbox inbox;
  app::FrameHandover handover([] {});
  KeepingSink sink;
  app::SimulationLoop loop(simulation, inbox, handover, &sink, {.tick_count = 10'100}, [] {});
  while (!loop.run_tick()) {
  }
  const step::PublishedFrame* with_snapshot = nullptr;
  for (const auto& frame : sink.frames)
    if (frame->snapshot) with_snapshot = frame.get();
  ASSERT_TRUE(with_snapshot);
  EXPECT_EQ(with_snapshot->snapshot_tick, 10'008u);
  step::Simulation again(organ);
  ASSERT_TRUE(again.restore_snapshot(*with_snapshot->snapshot).ok());
  for (const auto& record : with_snapshot->records) {
    if (record.tick < with_snapshot->snapshot_tick) continue;
    const auto hash = record.tick == with_snapshot->snapshot_tick
                          ? again.state_hash()
                          : again.tick(record.inputs, record.decisions).state_hash;
    EXPECT_EQ(hash, record.state_hash) << record.tick;
  }
}

TEST(CommandLine, listen_addresses) {
  app::ServerOptions options;
  ASSERT_TRUE(app::parse_listen_address("0.0.0.0:0", options).ok());
  EXPECT_EQ(options.address, "0.0.0.0");
  EXPECT_EQ(options.port, 0);
  ASSERT_TRUE(app::parse_listen_address("[::1]:7690", options).ok());
  EXPECT_EQ(options.address, "::1");
  for (const char* text : {"", "7690", ":7690", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536",
                           "127.0.0.1:-1", "127.0.0.1:80x"})
    EXPECT_FALSE(app::parse_listen_address(text, options).ok()) << text;
}

class ServerProcess : public ::testing::Test {
 protected:
  // Starts the program and waits for its port. Its files may grow to so many bytes; 0: to any size.
  std::uint16_t start(std::vector<std::string> arguments, const std::string& journal = "none",
                      std::uint64_t file_bytes = 0) {
    folder_ =
        std::filesystem::temp_directory_path() / ("trocar_server_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
    journal_ = journal == "none" ? journal : (folder_ / journal).string();
    const auto ready = folder_ / "port";
    for (const std::string& more :
         {std::string("--insecure-loopback"), std::string("--listen"), std::string("127.0.0.1:0"),
          std::string("--journal"), journal_, std::string("--organ"), std::string("lattice"),
          std::string("--log-level"), std::string("off"), std::string("--ready-file"),
          ready.string(), std::string("--summary"), (folder_ / "summary.json").string()})
      arguments.push_back(more);
    process::Command command{.words = {TROCAR_BINARY_DIR "/trocar-server"},
                             .out = STDOUT_FILENO,
                             .errors = STDERR_FILENO};
    if (file_bytes > 0)
      command.words = {"prlimit", "--fsize=" + std::to_string(file_bytes), command.words.front()};
    command.words.insert(command.words.end(), arguments.begin(), arguments.end());
    auto child = process::Child::start(command);
    EXPECT_TRUE(child) << child.error().message;
    child_.emplace(std::move(*child));
    for (int i = 0; i < 2000 && !std::filesystem::exists(ready); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    std::ifstream in(ready);
    std::uint16_t port = 0;
    in >> port;
    return port;
  }
  int wait_for_exit() { return child_->wait().exit_code.value_or(-1); }
  std::string summary() const {
    std::ifstream in(folder_ / "summary.json");
    std::stringstream text;
    text << in.rdbuf();
    return text.str();
  }
  void TearDown() override {
    child_.reset();
    std::filesystem::remove_all(folder_);
  }

  std::filesystem::path folder_;
  std::string journal_;
  std::optional<process::Child> child_;
};

TEST_F(ServerProcess, sigterm_asks_for_the_crc_says_goodbye_and_exits_with_0) {
  const auto port = start({});
  ASSERT_NE(port, 0);
  RawClient client(port);
  ASSERT_TRUE(client.send(make_hello("Anna", proto::ROLE_SURGEON)));
  const auto topology = client.receive(proto::Envelope::kSurfaceTopology);
  ASSERT_TRUE(topology);
  const auto vertices = topology->surface_topology().rest_position_quanta_size() / 3;
  client.surface.resize(static_cast<std::size_t>(vertices));
  // Press 4 mm into the top of the block (its top is at y = 70 mm) and follow for half a second.
  for (std::uint32_t i = 1; i <= 30; ++i) {
    auto sample = make_sample(i);
    sample.mutable_tool_sample()->mutable_position_m()->set_x(0.005f);
    sample.mutable_tool_sample()->mutable_position_m()->set_y(0.066f);
    sample.mutable_tool_sample()->mutable_position_m()->set_z(0.005f);
    *sample.mutable_tool_sample()->mutable_orientation() = [] {
      proto::Quat along_y;  // the shaft's +z turned to +y
      along_y.set_x(-0.70710678f);
      along_y.set_w(0.70710678f);
      return along_y;
    }();
    ASSERT_TRUE(client.send(sample));
    ASSERT_TRUE(client.follow());
  }
  EXPECT_NE(client.surface, wire::QuantisedSurface(client.surface.size())) << "nothing moved";
  child_->signal(SIGTERM);
  std::optional<proto::Goodbye> goodbye;
  while (auto message = client.receive()) {
    if (message->has_goodbye()) goodbye = message->goodbye();
    if (!message->has_surface_frame() && !message->has_barrier()) continue;
    if (message->has_barrier()) {
      proto::Envelope ack;
      ack.mutable_frame_ack()->set_frame(message->barrier().frame());
      ack.mutable_frame_ack()->set_surface_crc(wire::surface_crc(client.surface));
      ASSERT_TRUE(client.send(ack));
    } else {
      const auto& payload = message->surface_frame().payload();
      ASSERT_TRUE(wire::decode_delta(
                      {reinterpret_cast<const std::uint8_t*>(payload.data()), payload.size()},
                      client.surface)
                      .ok());
    }
  }
  ASSERT_TRUE(goodbye);
  EXPECT_EQ(goodbye->reason(), proto::GOODBYE_SERVER_CLOSING);
  EXPECT_EQ(wait_for_exit(), 0);
  EXPECT_NE(summary().find("\"all_replicas_equal\": true"), std::string::npos) << summary();
  EXPECT_NE(summary().find("\"name\": \"Anna\""), std::string::npos) << summary();
}

TEST_F(ServerProcess, more_signals_do_not_cut_the_end_of_the_recording_short) {
  const auto port = start({}, "two.mcap");
  ASSERT_NE(port, 0);
  RawClient client(port);
  ASSERT_TRUE(client.join("Anna", proto::ROLE_SURGEON));
  for (int i = 0; i < 3; ++i) child_->signal(i == 1 ? SIGINT : SIGTERM);
  while (client.receive())  // it answers nothing, so the end waits for it
    child_->signal(SIGTERM);
  EXPECT_EQ(wait_for_exit(), 0);
  const auto recorded = journal::McapReader::open(journal_);
  ASSERT_TRUE(recorded.ok());
  EXPECT_TRUE((*recorded)->is_finished());
}

TEST_F(ServerProcess, a_limit_of_file_sizes_ends_the_recording_and_nothing_else) {
  const auto port = start({}, "limit.mcap", 400'000);
  ASSERT_NE(port, 0);
  RawClient client(port);
  ASSERT_TRUE(client.join("Anna", proto::ROLE_SURGEON));
  proto::RecordingState state;
  while (state.status() != proto::RECORDING_FAILED) {
    const auto message = client.receive(proto::Envelope::kRecordingState);
    ASSERT_TRUE(message);
    state = message->recording_state();
  }
  EXPECT_NE(state.text().find("File too large"), std::string::npos) << state.text();
  EXPECT_TRUE(client.receive(proto::Envelope::kSurfaceFrame)) << "the session goes on";
  child_->signal(SIGTERM);
  while (client.receive()) {
  }
  EXPECT_EQ(wait_for_exit(), 5);
}

TEST_F(ServerProcess, a_taken_port_is_exit_code_5) {
  const auto port = start({});
  ASSERT_NE(port, 0);
  const std::string second =
      TROCAR_BINARY_DIR
      "/trocar-server --insecure-loopback --organ lattice --journal none --seconds 1 "
      "--listen 127.0.0.1:" +
      std::to_string(port) + " 2>/dev/null";
  EXPECT_EQ(WEXITSTATUS(std::system(second.c_str())), 5);
  child_->signal(SIGTERM);
  EXPECT_EQ(wait_for_exit(), 0);
}

TEST_F(ServerProcess, seconds_end_by_themselves) {
  ASSERT_NE(start({"--seconds", "0.5"}), 0);
  EXPECT_EQ(wait_for_exit(), 0);
  EXPECT_NE(summary().find("\"last_tick\": 512"), std::string::npos) << summary();
}

TEST(ServerProgram, wrong_options_are_2_and_unusable_organs_3) {
  const auto exit_code_of = [](const std::string& arguments) {
    const auto command = TROCAR_BINARY_DIR "/trocar-server " + arguments + " >/dev/null 2>&1";
    return WEXITSTATUS(std::system(command.c_str()));
  };
  EXPECT_EQ(exit_code_of("--help"), 0);
  EXPECT_EQ(exit_code_of("--version"), 0);
  EXPECT_EQ(exit_code_of("--no-such-option"), 2);
  EXPECT_EQ(exit_code_of("--omega 3"), 2);
  EXPECT_EQ(exit_code_of("--listen nowhere"), 2);
  EXPECT_EQ(exit_code_of("--insecure-loopback --listen 0.0.0.0:0"), 2);
  EXPECT_EQ(exit_code_of("--certificate server.crt"), 2);
  EXPECT_EQ(exit_code_of("--code-hours 0"), 2);
  EXPECT_EQ(exit_code_of("--log-level loud --organ lattice"), 2);
  EXPECT_EQ(exit_code_of("--organ /no/such/file.organ"), 3);
}

}  // namespace
}  // namespace trocar::testing
