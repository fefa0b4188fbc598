// Instruments in the hand of a real client on a calculated device, with a real server: jaws hold
// as much as theirs, a blade cuts as deep as its edge is long.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <fstream>

#include "client/replay/recorded_hand.h"
#include "common/journal/session_journal.h"
#include "common/math/box.h"
#include "common/tool/instrument.h"
#include "server/organs/catalogue/load_organ.h"
#include "tests/e2e/programs.h"

namespace trocar::e2e {
namespace {

namespace fs = std::filesystem;

// A device begins 30 mm in front of the organ, in the middle of its width and height.
constexpr double kBefore_m = 0.03;

// How far from there the liver is, mm.
double way_to_liver_mm() {
  const auto organ = catalogue::load_organ("liver");
  Box<float> box;
  for (const auto& place : organ->mesh.rest_positions) box.include(to_float(place));
  const Vec3f middle = (box.least + box.most) * 0.5f;
  double way_m = 1;
  for (const auto node : organ->mesh.surface_nodes) {
    const Vec3f place = to_float(organ->mesh.rest_positions[node.value]);
    if (std::hypot(place.x - middle.x, place.y - middle.y) > 0.008f) continue;
    way_m = std::min(way_m, static_cast<double>(box.most.z - place.z) + kBefore_m);
  }
  return 1e3 * way_m;
}

// A session with one hand leaves this.
struct Left {
  replay::RecordedHand hand;
  double greatest_n = 0;
  std::vector<tool::Verb> granted;
  int cuts = 0;  // changes of the topology
};

// Runs a hand that holds an instrument and follows key frames "s x y z gripper", mm; z is from the
// liver's surface outwards.
class Instruments : public ::testing::Test {
 protected:
  struct Key {
    double s, x_mm, z_mm, gripper;
  };

  Left use(const std::string& kind, std::initializer_list<Key> keys) {
    const auto folder = test_folder() / kind;
    fs::create_directories(folder);
    const double way_mm = way_to_liver_mm();
    std::ofstream path(folder / "path.txt");
    path << "0 0 0 0 0\n";
    for (const auto& key : keys)
      path << key.s << ' ' << key.x_mm << " 0 " << key.z_mm - way_mm << ' ' << key.gripper << '\n';
    path.close();
    Session session("liver");
    auto client = session.client(
        "Anna", "surgeon",
        {"--tool", kind, "--device", "simulated:path=" + (folder / "path.txt").string(),
         "--seconds", std::to_string(static_cast<int>(std::ceil((keys.end() - 1)->s)) + 1)});
    EXPECT_EQ(client.wait(120), 0) << read_text(session.folder / "Anna.log");
    session.server().signal(SIGTERM);
    EXPECT_EQ(session.server().wait(30), 0);
    fs::rename(session.journal, folder / "session.mcap");
    fs::remove(session.folder / "ready");  // another session may follow in this folder
    return read(folder / "session.mcap");
  }

 private:
  static Left read(const fs::path& file) {
    Left left;
    auto hand = replay::read_recorded_hand(file.string(), "Anna", 0);
    if (!hand) {
      ADD_FAILURE() << hand.error().message;
      return left;
    }
    left.hand = std::move(*hand);
    for (const auto& felt : left.hand.felt)
      left.greatest_n = std::max(left.greatest_n, static_cast<double>(length(felt.force_n)));
    auto journal = journal::SessionJournal::open(file.string());
    const Tick last = (*journal)->info().last_tick;
    EXPECT_TRUE((*journal)
                    ->read_claims(0, last,
                                  [&](Tick, const proto::ClaimLog& log) {
                                    for (const auto& event : log.event())
                                      if (event.outcome() == proto::CLAIM_GRANTED)
                                        left.granted.push_back(
                                            static_cast<tool::Verb>(event.verb()));
                                    return true;
                                  })
                    .ok());
    EXPECT_TRUE((*journal)
                    ->read_topology_changes(0, last,
                                            [&](Tick, const auto&) {
                                              ++left.cuts;
                                              return true;
                                            })
                    .ok());
    return left;
  }
};

bool has(const Left& left, tool::Verb verb) {
  return std::ranges::find(left.granted, verb) != left.granted.end();
}

TEST_F(Instruments, JawsGraspAndHoldAsMuchAsTheirOwn) {
  const auto pull = [&](const char* kind) {
    return use(kind, {{2, 0, 10, 0}, {3, 0, -3, 0}, {3.3, 0, -3, 1}, {6, 0, 45, 1}, {7, 0, 45, 1}});
  };
  const auto grasper = pull("grasper"), hook = pull("hook");
  EXPECT_EQ(grasper.hand.shape, tool::find_instrument("grasper")->shape);
  EXPECT_EQ(hook.hand.shape, tool::find_instrument("hook")->shape);
  EXPECT_TRUE(has(grasper, tool::Verb::Grasp));
  EXPECT_TRUE(has(hook, tool::Verb::Grasp));
  EXPECT_EQ(grasper.cuts + hook.cuts, 0);
  std::printf("grasper %.2f N, hook %.2f N\n", grasper.greatest_n, hook.greatest_n);
  const auto limit_n = [](const char* kind) {
    return static_cast<double>(tool::find_instrument(kind)->shape.grip_n);
  };
  EXPECT_LE(hook.greatest_n, 1.05 * limit_n("hook")) << "it slips";
  EXPECT_GT(grasper.greatest_n, limit_n("hook")) << "it holds";
  EXPECT_LE(grasper.greatest_n, limit_n("grasper"));
}

TEST_F(Instruments, AScalpelCutsByItsEdge) {
  const auto scalpel = use(
      "scalpel", {{2, 0, 10, 0}, {2.5, 0, 10, 1}, {4, 0, -10, 1}, {6, 25, -10, 1}, {7, 25, 15, 1}});
  EXPECT_EQ(scalpel.hand.shape, tool::find_instrument("scalpel")->shape);
  EXPECT_TRUE(has(scalpel, tool::Verb::Cut));
  EXPECT_FALSE(has(scalpel, tool::Verb::Grasp));
  EXPECT_GT(scalpel.cuts, 0);
  std::printf("scalpel %.2f N, %d cuts\n", scalpel.greatest_n, scalpel.cuts);
  EXPECT_GT(scalpel.greatest_n, 0.3);
  // The energy of a wound, 150 J/m^2, times the edge, and as much again for what varies from
  // element to element, and friction.
  const auto edge_m = static_cast<double>(scalpel.hand.shape.edge_m);
  EXPECT_LT(scalpel.greatest_n, 2 * 150 * edge_m);
}

}  // namespace
}  // namespace trocar::e2e
