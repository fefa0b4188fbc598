// Loads of scenarios in recordings: trocar-sim records what moves, holds and loads the tissue
// besides its tools, verification simulates it again to the bit, and loads that were changed,
// removed or cannot be are found.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <limits>

#include "common/base/checksum.h"
#include "common/journal/session_journal.h"
#include "proto/journal.pb.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/organ/organ_file.h"
#include "server/session/recording/load_messages.h"
#include "server/session/recording/recorded_session.h"
#include "server/session/recording/resume.h"
#include "server/session/recording/verify.h"
#include "tests/recording/recorded_simulation.h"
#include "tests/support/files.h"
#include "tests/support/program_fixture.h"

namespace trocar::recording::testing {
namespace {

using trocar::testing::load_file;
using trocar::testing::TemporaryFolder;

// A block settles under its weight, a blade parts its upper half, and then its top is drawn aside
// and lifted. One side is a plane of symmetry, another one is pulled, a third is under pressure. It
// ends after the snapshot of tick 10,008.
constexpr const char* kCutAndPulled = R"([organ]
source = "block"
nodes = [7, 5, 7]
spacing_mm = 5
[material]
elastic_law = "neo-hookean"
[gravity]
m_s2 = [0, -9.81, 0]
[[nodes]]
name = "top"
box_min_mm = [-15, 10, -15]
box_max_mm = [15, 10, 15]
[[nodes]]
name = "right"
box_min_mm = [15, -5, -15]
box_max_mm = [15, 5, 15]
[[nodes]]
name = "front"
box_min_mm = [-15, -5, 15]
box_max_mm = [10, 5, 15]
[[nodes]]
name = "back"
box_min_mm = [-15, -10, -15]
box_max_mm = [15, 10, -15]
[[displace]]
set = "top"
key = [{time_s = 0.3, displacement_mm = [0, 0, 0]}, {time_s = 1, displacement_mm = [1.1, 2.3, 0]}]
[[displace]]
set = "right"
axes = "x"
[[force]]
set = "front"
key = [{time_s = 0, force_n = [0, 0, 0]}, {time_s = 0.5, force_n = [0.01, 0, 0.07]}]
[[traction]]
set = "back"
key = [{time_s = 0, pressure_pa = 0}, {time_s = 2, pressure_pa = 150}]
[[tool]]
radius_mm = 1
edge_mm = 30
key = [{time_s = 0, position_mm = [-30, 2, 0], shaft = [0, 1, 0], verb = "cut"},
       {time_s = 0.2, position_mm = [30, 2, 0]}]
[[probe]]
set = "fixed"
quantity = "reaction"
[[probe]]
set = "top"
quantity = "reaction"
[run]
seconds = 10.032
start = "equilibrium"
[output]
fields_s = [10.032]
)";
constexpr Tick kTicks = 10'032, kSnapshotTick = 10'008;

// Tissue that relaxes is pressed; nothing but the probe says that its fixed nodes are placed.
constexpr const char* kProbed = R"([organ]
source = "block"
nodes = [5, 3, 5]
spacing_mm = 5
[material]
elastic_law = "measured"
measured = "human_liver_nava2008"
[[tool]]
radius_mm = 4
key = [{time_s = 0, position_mm = [0, 10, 0], shaft = [0, 1, 0], verb = "push"},
       {time_s = 0.2, position_mm = [0, 6, 0]}]
[[probe]]
set = "fixed"
quantity = "reaction"
[run]
like = "session"
seconds = 0.32
)";

// No load acts, but the block has settled under its weight.
constexpr const char* kSettled = R"([organ]
source = "block"
nodes = [5, 5, 5]
spacing_mm = 5
[material]
elastic_law = "neo-hookean"
[gravity]
m_s2 = [0, -9.81, 0]
[[tool]]
radius_mm = 4
key = [{time_s = 0, position_mm = [0, 20, 0], shaft = [0, 1, 0], verb = "push"},
       {time_s = 0.2, position_mm = [0, 8, 0]}]
[run]
start = "equilibrium"
seconds = 0.32
)";

int run_program(const std::string& arguments, const std::string& log) {
  const int status =
      std::system((TROCAR_BINARY_DIR "/" + arguments + " > " + log + " 2>&1").c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

class ScenarioLoads : public trocar::testing::ProgramFixture {
 protected:
  ScenarioLoads() : ProgramFixture("trocar-sim") {}

  // Each is recorded once for all tests.
  static const std::string& cut_and_pulled() {
    static const std::string path = record("cut_and_pulled", kCutAndPulled);
    return path;
  }
  static const std::string& probed() {
    static const std::string path = record("probed", kProbed);
    return path;
  }
  static const std::string& settled() {
    static const std::string path = record("settled", kSettled);
    return path;
  }

  // The recording with changed loads. False from `change`: without them.
  template <typename Change>
  Result<VerifyReport> verify_changed(const std::string& from, Change change) {
    const auto copy = at("copy.mcap");
    std::filesystem::remove(copy);
    int changed = 0;
    copy_journal(from, copy, [&](std::string_view topic, google::protobuf::Message& message) {
      if (topic != "/loads") return true;
      ++changed;
      return change(static_cast<proto::ExternalLoads&>(message));
    });
    EXPECT_EQ(changed, 1) << "loads are there once";
    return verify_journal(copy);
  }
  void expect_different(const Result<VerifyReport>& report, Tick at_most) {
    ASSERT_TRUE(report.ok()) << report.error().message;
    EXPECT_EQ(report->verdict(), Verdict::Different) << report->why();
    ASSERT_TRUE(report->first_difference);
    EXPECT_LE(report->first_difference->tick, at_most) << report->first_difference->text();
    EXPECT_EQ(verify_program(at("copy.mcap")), 1);
  }
  int verify_program(const std::string& path) {
    return run_program("trocar-journal verify " + path, at("verify.log"));
  }

 private:
  static const TemporaryFolder& recordings() {
    static const TemporaryFolder folder;
    return folder;
  }
  static std::string record(const std::string& name, const char* scenario) {
    const auto& folder = recordings();
    const auto file = folder.file(name + ".toml"), journal = folder.file(name + ".mcap"),
               log = folder.file(name + ".log");
    std::ofstream(file) << scenario;
    EXPECT_EQ(
        run_program("trocar-sim " + file + " --out " + folder.file(name) + " --journal " + journal,
                    log),
        0)
        << read(log);
    EXPECT_EQ(read(log).find("warning"), std::string::npos) << read(log);
    return journal;
  }
};

TEST_F(ScenarioLoads, ACutUnderLoadsIsVerifiedWhole) {
  const auto report = verify_journal(cut_and_pulled());
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report->verdict(), Verdict::Verified) << report->why();
  EXPECT_EQ(report->last_tick, kTicks);
  EXPECT_EQ(report->ticks_verified, kTicks);
  EXPECT_EQ(report->snapshots_verified, 1u);
  EXPECT_EQ(report->snapshots_continued, 1u);
  EXPECT_EQ(report->frames_verified, kTicks / kTicksPerFrame);
  EXPECT_EQ(verify_program(cut_and_pulled()), 0) << read(at("verify.log"));
  // The cut went through what is displaced, and the snapshot knows it.
  auto journal = journal::SessionJournal::open(cut_and_pulled());
  ASSERT_TRUE(journal.ok());
  EXPECT_TRUE((*journal)->info().has_external_loads);
  EXPECT_TRUE((*journal)->info().begins_with_snapshot());
  ASSERT_EQ(run_program("trocar-journal info " + cut_and_pulled(), at("info.log")), 0);
  for (const char* line : {"loads        of a scenario", "start        the first snapshot"})
    EXPECT_NE(read(at("info.log")).find(line), std::string::npos) << read(at("info.log"));
  auto organ = recorded_organ(**journal, "");
  ASSERT_TRUE(organ.ok());
  auto loads = recorded_loads(**journal, *organ, "");
  ASSERT_TRUE(loads.ok()) << loads.error().message;
  const auto nodes = organ->mesh.node_count();
  step::Simulation simulation(*organ, 1, {.loads = *loads});
  const auto snapshot = (*journal)->snapshot_before(kTicks);
  ASSERT_TRUE(snapshot.ok() && *snapshot);
  EXPECT_EQ((*snapshot)->tick(), kSnapshotTick);
  ASSERT_TRUE(simulation.restore_snapshot(bytes_of(std::string_view((*snapshot)->state()))));
  const auto& world = simulation.state().world;
  std::size_t drawn = 0;
  for (std::size_t n = nodes; n < world.node_count(); ++n)
    drawn += world.displacements[n] == Vec3f{1.1e-3f, 2.3e-3f, 0} ? 1 : 0;
  EXPECT_GE(drawn, 7u) << "nodes that the cut made between displaced ones";
}

TEST_F(ScenarioLoads, AProbedReactionIsVerified) {
  const auto report = verify_journal(probed());
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report->verdict(), Verdict::Verified) << report->why();
  // Tissue that relaxes is advanced otherwise where it is measured.
  expect_different(verify_changed(probed(),
                                  [](auto& loads) {
                                    loads.set_has_measured_reactions(false);
                                    auto& load = *loads.add_displaced();
                                    load.add_node(74);
                                    load.set_axes(1);
                                    load.mutable_displacement_m()->add_time_s(0);
                                    for (int i = 0; i < 3; ++i)
                                      load.mutable_displacement_m()->add_value(0);
                                    return true;
                                  }),
                   320);
}

TEST_F(ScenarioLoads, AStartInEquilibriumIsVerified) {
  const auto report = verify_journal(settled());
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report->verdict(), Verdict::Verified) << report->why();
  EXPECT_EQ(report->ticks_verified, 320u);
  // Another state to begin with is another session.
  const auto copy = at("moved.mcap");
  copy_journal(settled(), copy, [](std::string_view topic, google::protobuf::Message& message) {
    if (topic != "/world/snapshot") return true;
    auto& snapshot = static_cast<proto::WorldSnapshot&>(message);
    (*snapshot.mutable_state())[135] ^= 1;
    snapshot.set_state_hash(xxh3_64(bytes_of(std::string_view(snapshot.state()))));
    return true;
  });
  const auto moved = verify_journal(copy);
  ASSERT_TRUE(moved.ok());
  EXPECT_EQ(moved->verdict(), Verdict::Different);
  ASSERT_TRUE(moved->first_difference);
  EXPECT_EQ(moved->first_difference->tick, 1u);
}

TEST_F(ScenarioLoads, AChangedLoadIsFound) {
  const auto& sound = cut_and_pulled();
  expect_different(
      verify_changed(sound,
                     [](auto& loads) {
                       auto& values =
                           *loads.mutable_loaded(0)->mutable_over_time()->mutable_value();
                       values.Set(5, values.Get(5) * (1 + 1e-6));
                       return true;
                     }),
      500);
  expect_different(
      verify_changed(sound,
                     [](auto& loads) {
                       auto& times =
                           *loads.mutable_displaced(0)->mutable_displacement_m()->mutable_time_s();
                       times.Set(1, times.Get(1) + 1e-3);
                       return true;
                     }),
      1000);
  expect_different(verify_changed(sound,
                                  [](auto& loads) {
                                    auto& load = *loads.mutable_loaded(1);
                                    // In the middle of the side, where nothing holds it.
                                    const int z = load.normal_area_m2_size() / 6 * 3 + 2;
                                    load.set_normal_area_m2(z, load.normal_area_m2(z) * 0.99);
                                    return true;
                                  }),
                   2000);
}

TEST_F(ScenarioLoads, ARemovedLoadIsFound) {
  const auto& sound = cut_and_pulled();
  for (const int load : {0, 1})
    expect_different(verify_changed(sound,
                                    [load](auto& loads) {
                                      loads.mutable_loaded()->DeleteSubrange(load, 1);
                                      return true;
                                    }),
                     kTicks);
  for (const int load : {0, 1})
    expect_different(verify_changed(sound,
                                    [load](auto& loads) {
                                      loads.mutable_displaced()->DeleteSubrange(load, 1);
                                      return true;
                                    }),
                     kTicks);
}

// Older recordings are such.
TEST_F(ScenarioLoads, WithoutItsLoadsARecordingCannotBeVerified) {
  const auto report = verify_changed(cut_and_pulled(), [](auto&) { return false; });
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report->verdict(), Verdict::NotVerified);
  EXPECT_FALSE(report->is_resimulated);
  EXPECT_GT(report->surfaces_decoded, kTicks / kTicksPerFrame - 1);
  EXPECT_NE(report->why().find("which it does not hold"), std::string::npos) << report->why();
  EXPECT_EQ(verify_program(at("copy.mcap")), 6);
  EXPECT_EQ(run({"--hands", at("copy.mcap"), "--out", at("out")}), 3);
  expect_line("is of a scenario with loads, which it does not hold");
}

TEST_F(ScenarioLoads, AnImpossibleLoadIsRefused) {
  const auto report = verify_changed(cut_and_pulled(), [](auto& loads) {
    loads.mutable_loaded(0)->set_node(0, 1);
    loads.mutable_loaded(0)->set_node(loads.loaded(0).node_size() - 1, 245);
    return true;
  });
  ASSERT_FALSE(report.ok());
  EXPECT_NE(report.error().message.find("copy.mcap: /loads: loaded[0]: node 245 is none of the "
                                        "organ's 245"),
            std::string::npos)
      << report.error().message;
  EXPECT_EQ(verify_program(at("copy.mcap")), 3);
}

TEST_F(ScenarioLoads, TheHandsOfARecordingTakeItsLoadsAlong) {
  const auto& journal = cut_and_pulled();
  const auto state = [this] {
    const auto line = log();
    return line.substr(line.find("state "), 22);
  };
  ASSERT_EQ(run({"--hands", journal, "--out", at("same"), "--journal", at("same.mcap")}), 0)
      << log();
  const auto recorded = state();
  EXPECT_EQ(read(folder_ / "same" / "field_0010032ms.csv"),
            read(std::filesystem::path(journal).replace_extension("") / "field_0010032ms.csv"));
  EXPECT_EQ(verify_program(at("same.mcap")), 0) << read(at("verify.log"));

  // Softer tissue with the same nodes is pulled as well; another organ has other nodes.
  auto opened = journal::SessionJournal::open(journal);
  ASSERT_TRUE(opened.ok());
  auto organ = recorded_organ(**opened, journal);
  ASSERT_TRUE(organ.ok());
  organ->material.young_modulus_pa /= 2;
  ASSERT_TRUE(organ::write_organ(at("soft.organ"), *organ));
  ASSERT_EQ(run({"--hands", journal, "--organ", at("soft.organ"), "--out", at("soft"), "--journal",
                 at("soft.mcap")}),
            0)
      << log();
  EXPECT_NE(log().find(": this one starts at rest"), std::string::npos) << log();
  EXPECT_EQ(log().find("left out"), std::string::npos) << log();
  EXPECT_NE(state(), recorded);
  EXPECT_EQ(verify_program(at("soft.mcap")), 0) << read(at("verify.log"));
  ASSERT_EQ(run({"--hands", probed(), "--organ", "liver", "--out", at("other")}), 0) << log();
  EXPECT_NE(log().find("its loads are of the nodes of its own organ, and are left out"),
            std::string::npos)
      << log();
}

TEST_F(ScenarioLoads, NoSessionGoesOnWithThem) {
  const auto session = resume_session(cut_and_pulled(), {});
  ASSERT_FALSE(session.ok());
  EXPECT_NE(session.error().message.find("loads besides tools, which no session has"),
            std::string::npos)
      << session.error().message;
}

// ---- the message ----

step::LoadRules rules_of_everything() {
  const step::TimedVector curve{{{0, {0.1, -0.0, 1e-300}}, {1.0 / 3, {0.2, 3, 4}}}};
  return {.displaced = {{{NodeIndex(3), NodeIndex(5)}, step::kAllAxes, curve},
                        {{NodeIndex(4)}, 5, {{{7, {}}}}}},
          .forces = {{{NodeIndex(3), NodeIndex(6)}, curve, {0.1, 1.0 / 3}, {}},
                     {{NodeIndex(9)}, curve, {}, {{1e-5, -2e-5, 0.1}}}},
          .has_measured_reactions = true};
}

Result<step::LoadRules> read_changed(const std::function<void(proto::ExternalLoads&)>& change) {
  proto::ExternalLoads message;
  to_message(rules_of_everything(), message);
  change(message);
  const auto organ = catalogue::make_lattice({3, 3, 3, 0.01});
  return from_message(message, *organ);
}

TEST(LoadMessages, AreReadAsTheyWereWritten) {
  const auto read = read_changed([](auto& message) {
    const auto bytes = message.SerializeAsString();
    ASSERT_TRUE(message.ParseFromString(bytes));
  });
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(*read, rules_of_everything());
  EXPECT_TRUE(std::signbit(read->displaced[0].over_time.keys[0].value.y));
}

TEST(LoadMessages, AreRefusedWhenTheyCannotBe) {
  const auto refused = [](const char* says,
                          const std::function<void(proto::ExternalLoads&)>& change) {
    const auto read = read_changed(change);
    ASSERT_FALSE(read.ok()) << says;
    EXPECT_NE(read.error().message.find(says), std::string::npos) << read.error().message;
    EXPECT_EQ(read.error().message.find('\n'), std::string::npos);
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  refused("displaced[0]: has no nodes", [](auto& m) { m.mutable_displaced(0)->clear_node(); });
  refused("displaced[0]: node 27 is none of the organ's 27",
          [](auto& m) { m.mutable_displaced(0)->set_node(1, 27); });
  refused("loaded[1]: node 4294967295 is none of the organ's 27",
          [](auto& m) { m.mutable_loaded(1)->set_node(0, 0xffffffffu); });
  refused("displaced[0]: its nodes are not in ascending order, each once",
          [](auto& m) { m.mutable_displaced(0)->set_node(1, 3); });
  refused("displaced[1]: node 5 is held already along that axis",
          [](auto& m) { m.mutable_displaced(1)->set_node(0, 5); });
  for (const std::uint32_t axes : {0u, 8u, 0x107u})
    refused("displaced[1]: holds along no axis",
            [axes](auto& m) { m.mutable_displaced(1)->set_axes(axes); });
  refused("displaced[1]: has no keys",
          [](auto& m) { m.mutable_displaced(1)->clear_displacement_m(); });
  refused("loaded[0]: has no keys",
          [](auto& m) { m.mutable_loaded(0)->mutable_over_time()->add_value(0); });
  for (const double time : {0.0, -1.0, kNan, kInfinity})
    refused("loaded[0]: the times of its keys do not increase",
            [time](auto& m) { m.mutable_loaded(0)->mutable_over_time()->set_time_s(1, time); });
  for (const double value : {10.5, -11.0, kNan, kInfinity})
    refused("displaced[0]: a key's value is not within 10", [value](auto& m) {
      m.mutable_displaced(0)->mutable_displacement_m()->set_value(4, value);
    });
  refused("loaded[1]: a key's value is not within 1000000000",
          [](auto& m) { m.mutable_loaded(1)->mutable_over_time()->set_value(0, 2e9); });
  for (const double share : {101.0, kNan, -kInfinity}) {
    refused("loaded[0]: a node's share is not within 100",
            [share](auto& m) { m.mutable_loaded(0)->set_share(1, share); });
    refused("loaded[1]: a node's share is not within 100",
            [share](auto& m) { m.mutable_loaded(1)->set_normal_area_m2(2, share); });
  }
  refused("loaded[0]: it needs one share, or one area, for each node",
          [](auto& m) { m.mutable_loaded(0)->add_share(1); });
  refused("loaded[1]: it needs one share, or one area, for each node",
          [](auto& m) { m.mutable_loaded(1)->add_share(1); });
  refused("loaded[1]: its areas are not three numbers each",
          [](auto& m) { m.mutable_loaded(1)->add_normal_area_m2(1); });
}

}  // namespace
}  // namespace trocar::recording::testing
