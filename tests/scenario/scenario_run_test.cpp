// Scenarios on the engine: against closed forms, balance of forces, and the same bits twice.

#include "server/lab/scenario/scenario_run.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "server/lab/scenario/field_files.h"
#include "server/lab/scenario/probe_file.h"
#include "server/tissue/cutting/validate.h"
#include "tests/scenario/scenario_texts.h"

namespace trocar::scenario {
namespace {

TEST(ScenarioRun, AColumnUnderAForceStretchesLikeSpringsInSeries) {
  const auto run = make(kColumn + R"([[force]]
set = "top"
key = [{time_s = 0, force_n = [0, 0.4, 0]}]
[run]
seconds = 4
[[probe]]
set = "top"
quantity = "displacement"
[[probe]]
set = "fixed"
quantity = "reaction"
)");
  ASSERT_TRUE(run);
  finish(*run);
  const double expected = 0.4 / 4 * 5 / kStiffness;  // 12.5 mm
  EXPECT_NEAR(run->probe(0).y, expected, 1e-3 * expected);
  EXPECT_NEAR(run->probe(0).x, 0, 1e-6);
  EXPECT_NEAR(run->probe(1).y, -0.4, 4e-4) << "the support pulls down what the force pulls up";
}

TEST(ScenarioRun, TheReactionOfADisplacedSetEqualsTheForceOfTheSameStretch) {
  const auto run = make(kColumn + R"([[displace]]
set = "top"
key = [{time_s = 0, displacement_mm = [0, 0, 0]}, {time_s = 0.2, displacement_mm = [0, 12.5, 0]}]
[run]
seconds = 3
[[probe]]
set = "top"
quantity = "reaction"
[[probe]]
set = "fixed"
quantity = "reaction"
[[probe]]
set = "top"
quantity = "displacement"
)");
  ASSERT_TRUE(run);
  finish(*run);
  EXPECT_NEAR(run->probe(0).y, 0.4, 4e-4);
  EXPECT_NEAR(run->probe(1).y, -0.4, 4e-4);
  EXPECT_EQ(run->probe(2).y, static_cast<double>(0.0125f)) << "held exactly where it was put";
}

TEST(ScenarioRun, AHangingColumnSagsLikeItsClosedForm) {
  // Gravity away from the support: a lattice has no shear stiffness, so a standing column falls
  // over.
  const auto run = make(kColumn + R"([gravity]
m_s2 = [0, 9.81, 0]
[run]
seconds = 4
[[probe]]
set = "top"
quantity = "displacement"
[[probe]]
set = "fixed"
quantity = "reaction"
)");
  ASSERT_TRUE(run);
  finish(*run);
  // Spring j from the support carries the nodes j to 5 of its chain.
  const auto& masses = run->organ().node_masses_kg;
  double sag = 0, total = 0;
  for (int j = 1; j <= 5; ++j)
    for (int i = j; i <= 5; ++i)
      sag += masses[static_cast<std::size_t>(2 * i)] * kWeight / kStiffness;
  for (const double mass : masses) total += mass * kWeight;
  EXPECT_GT(sag, 1e-4);
  EXPECT_NEAR(run->probe(0).y, sag, 1e-3 * sag);
  EXPECT_NEAR(run->probe(1).y, -total, 1e-3 * total) << "the support carries all of it";
}

TEST(ScenarioRun, AStaticRunIsInEquilibriumAtEachLoadStep) {
  const auto run = make(kColumn + R"([[force]]
set = "top"
key = [{time_s = 0, force_n = [0, 0, 0]}, {time_s = 1, force_n = [0, 0.4, 0]}]
[run]
mode = "static"
seconds = 1
load_steps = 2
[[probe]]
set = "top"
quantity = "displacement"
[[probe]]
set = "fixed"
quantity = "reaction"
)");
  ASSERT_TRUE(run);
  const double expected = 0.4 / 4 * 5 / kStiffness;
  for (const double share : {0.5, 1.0}) {
    EXPECT_TRUE(run->step().is_converged);
    EXPECT_EQ(run->time_s(), share);
    EXPECT_NEAR(run->probe(0).y, share * expected, 1e-3 * expected);
    EXPECT_NEAR(run->probe(1).y, -share * 0.4, 4e-4);
  }
  EXPECT_TRUE(run->is_finished());
}

// Springs along three axes have no shear stiffness, so that they buckle wherever they are
// compressed. Sweeps that overshoot once left this equilibrium for others, hundreds of millimetres
// away.
TEST(ScenarioRun, AStaticPullAtALatticeStaysInTheEquilibriumItCameFrom) {
  constexpr double kForce_n = 0.05, kAlongColumn = 1, kSpringsBelow = 14, kPulled = 9;
  const auto pull = [](const char* fibres) {
    return make(std::string(R"([organ]
source = "lattice"
nodes = [16, 15, 16]
spacing_mm = 10
[material]
spring_stiffness_n_m = 10
)") + fibres + R"([[nodes]]
name = "patch"
nearest_mm = [5, 70, 5]
radius_mm = 14.2
[[force]]
set = "patch"
key = [{time_s = 0, force_n = [0, 0, 0]}, {time_s = 1, force_n = [0, 0.05, 0]}]
[run]
mode = "static"
seconds = 1
load_steps = 3
tolerance_n = 4e-6
max_sweeps = 8000
[[probe]]
set = "patch"
quantity = "displacement"
)");
  };
  const auto stiff = pull("");
  const auto soft = pull("fibre_direction = [0, 1, 0]\nfibre_stiffness_ratio = 0.1\n");
  ASSERT_TRUE(stiff && soft);
  Vec3d before;
  for (int step = 1; step <= 3; ++step) {
    EXPECT_TRUE(stiff->step().is_converged) << step;
    EXPECT_TRUE(soft->step().is_converged) << step;
    const Vec3d moved = soft->probe(0);
    EXPECT_GT(moved.y, before.y) << "a larger force pulls further";
    // The columns below alone would stretch so far; the springs across only hold them back.
    EXPECT_LT(moved.y, kForce_n * step / 3 / kPulled * kSpringsBelow / kAlongColumn);
    EXPECT_GT(moved.y, stiff->probe(0).y) << "softer along the pull";
    EXPECT_LT(std::hypot(moved.x, moved.z), 0.05 * moved.y) << "along the pull";
    before = moved;
  }
}

TEST(ScenarioRun, AToolPressesInAStaticRun) {
  const auto run = make(R"([organ]
source = "liver"
[[tool]]
radius_mm = 15
anchor = [0, 1, 0]
key = [{time_s = 0, position_mm = [0, 10, 0], shaft = [0, 1, 0], verb = "push"},
       {time_s = 1, position_mm = [0, -5, 0]}]
[run]
mode = "static"
seconds = 1
load_steps = 2
tolerance_n = 1e-5
[[probe]]
tool = 0
quantity = "force"
[[probe]]
set = "fixed"
quantity = "reaction"
)");
  ASSERT_TRUE(run);
  run->step();
  EXPECT_EQ(run->probe(0).y, 0) << "still above the tissue";
  EXPECT_TRUE(run->step().is_converged);
  EXPECT_GT(run->probe(0).y, 0.1);
  EXPECT_NEAR(run->probe(1).y, run->probe(0).y, 0.01 * run->probe(0).y);
}

TEST(ScenarioRun, StartingInEquilibriumNothingMoves) {
  const std::string text = kColumn + R"([gravity]
m_s2 = [0, 9.81, 0]
[run]
seconds = 0.2
start = "equilibrium"
[[probe]]
set = "top"
quantity = "displacement"
[[probe]]
set = "top"
quantity = "velocity"
)";
  const auto run = make(text);
  ASSERT_TRUE(run && run->settling().is_converged);
  run->step();
  const Vec3d first = run->probe(0);
  EXPECT_GT(first.y, 1e-4) << "it hangs";
  double fastest = 0;
  while (!run->is_finished()) {
    run->step();
    fastest = std::max(fastest, length(run->probe(1)));
  }
  EXPECT_LT(length(run->probe(0) - first), 0.01 * first.y);
  EXPECT_LT(fastest, 1e-3);
}

TEST(ScenarioRun, TissueThatRelaxesStartsWhereItHasHungForLong) {
  for (const char* strain : {"false", "true"}) {
    const std::string text = std::string(R"([organ]
source = "block"
nodes = [4, 6, 4]
spacing_mm = 8
[material]
elastic_law = "measured"
measured = "human_liver_nava2008"
averaged_strain = )") + strain +
                             R"(
[[nodes]]
name = "top"
box_min_mm = [-20, 19, -20]
box_max_mm = [20, 21, 20]
[gravity]
m_s2 = [0, -9.81, 0]
[run]
seconds = 0.3
start = "equilibrium"
[[probe]]
set = "top"
quantity = "displacement"
)";
    const auto run = make(text);
    ASSERT_TRUE(run && run->settling().is_converged);
    run->step();
    const Vec3d first = run->probe(0);
    EXPECT_LT(first.y, -1e-4) << "it sags";
    while (!run->is_finished()) run->step();
    EXPECT_LT(length(run->probe(0) - first), 0.01 * length(first));
  }
}

TEST(ScenarioRun, TensionPullsAtWhatHoldsTheEnds) {
  std::string text = kColumn + R"([[displace]]
set = "top"
key = [{time_s = 0, displacement_mm = [0, 0, 0]}]
[run]
mode = "static"
seconds = 1
[[probe]]
set = "top"
quantity = "reaction"
)";
  text.insert(text.find("node_damping"), "tension = 0.1\n");
  const auto run = make(text);
  ASSERT_TRUE(run);
  run->step();
  // 1 % more, because the springs across shorten too and tilt the chains' ends.
  EXPECT_NEAR(run->probe(0).y, 4 * kStiffness * 0.1 * 0.01, 0.015 * 0.16);
}

TEST(ScenarioRun, ShorterStepsAreMoreStepsOfTheSameTime) {
  const auto text = [](const char* dt) {
    return kColumn + R"([[force]]
set = "top"
key = [{time_s = 0, force_n = [0, 0.4, 0]}]
[[probe]]
set = "top"
quantity = "displacement"
[run]
seconds = 0.05
)" + dt;
  };
  const auto coarse = make(text(""), Solver::Live),
             fine = make(text("dt_s = 0.0001\n"), Solver::Live),
             finest = make(text("dt_s = 0.00002\n"), Solver::Live);
  ASSERT_TRUE(coarse && fine && finest);
  for (const auto& run : {coarse.get(), fine.get(), finest.get()}) finish(*run);
  EXPECT_EQ(fine->time_s(), 0.05);
  EXPECT_EQ(fine->steps_done(), 50u);
  const double exact = finest->probe(0).y;
  EXPECT_LT(std::abs(fine->probe(0).y - exact), 0.2 * std::abs(coarse->probe(0).y - exact));
}

TEST(ScenarioRun, AMovingColumnKeepsNewtonsLaw) {
  // While it moves: forces from outside equal the change of momentum and what nodal damping takes.
  const auto run = make(kColumn + R"([gravity]
m_s2 = [0, -9.81, 0]
[[displace]]
set = "top"
key = [{time_s = 0, displacement_mm = [0, 0, 0]}, {time_s = 0.05, displacement_mm = [2, 5, 0]}]
[run]
seconds = 0.1
tolerance_n = 1e-6
[[probe]]
set = "top"
quantity = "reaction"
[[probe]]
set = "fixed"
quantity = "reaction"
)");
  ASSERT_TRUE(run);
  const auto& world = run->world();
  Vec3d before;
  while (!run->is_finished()) {
    const auto report = run->step();
    Vec3d momentum, weight;
    for (std::size_t i = 0; i < world.node_count(); ++i) {
      const double mass = static_cast<double>(world.masses[i]);
      momentum += to_double(world.velocities[i]) * mass;
      weight += Vec3d{0, -kWeight, 0} * mass;
    }
    const Vec3d outside = run->probe(0) + run->probe(1) + weight - momentum * 20.0;
    const double bound = 2e-5 + 24 * static_cast<double>(report.solve.residual_n);
    EXPECT_LT(length((momentum - before) * 1e3 - outside), bound) << "tick " << run->steps_done();
    before = momentum;
  }
  EXPECT_GT(length(before), 0);
}

TEST(ScenarioRun, TheFullSolverReachesItsToleranceInEveryStep) {
  const std::string text = R"([organ]
source = "lattice"
nodes = [5, 5, 5]
[[nodes]]
name = "corner"
nearest_mm = [20, 20, 20]
[[force]]
set = "corner"
key = [{time_s = 0, force_n = [0, 0, 0]}, {time_s = 0.1, force_n = [0.05, 0.1, 0]}]
[run]
seconds = 0.2
tolerance_n = 1e-6
)";
  const auto full = make(text), live = make(text, Solver::Live);
  ASSERT_TRUE(full && live);
  float worst_live = 0;
  while (!full->is_finished()) {
    const auto report = full->step();
    EXPECT_LE(report.solve.residual_n, 1e-6f) << "tick " << full->steps_done();
    EXPECT_TRUE(report.is_converged);
    worst_live = std::max(worst_live, live->step().solve.residual_n);
  }
  EXPECT_GT(worst_live, 1e-6f) << "otherwise this test shows nothing";
}

TEST(ScenarioRun, AStepThatHitsTheCapSaysSo) {
  const auto run = make(kColumn + R"([gravity]
m_s2 = [0, -9.81, 0]
[run]
seconds = 0.01
tolerance_n = 1e-9
max_sweeps = 2
)");
  ASSERT_TRUE(run);
  const auto report = run->step();
  EXPECT_FALSE(report.is_converged);
  EXPECT_EQ(report.solve.sweeps, 2u);
}

TEST(ScenarioRun, AToolPressesAndItsForceIsCarriedByTheSupport) {
  // Short: pressed for longer, a lattice without shear stiffness buckles and slips off the tool.
  const auto run = make(R"([organ]
source = "block"
nodes = [7, 5, 7]
spacing_mm = 10
[material]
elastic_law = "neo-hookean"
[[tool]]
radius_mm = 15
key = [{time_s = 0, position_mm = [0, 25, 0], shaft = [0, 1, 0], verb = "push"},
       {time_s = 0.3, position_mm = [0, 18, 0]}]
[run]
seconds = 1
[[probe]]
tool = 0
quantity = "force"
[[probe]]
set = "fixed"
quantity = "reaction"
)");
  ASSERT_TRUE(run);
  finish(*run);
  const double force = run->probe(0).y;
  EXPECT_GT(force, 0.015) << "the tissue pushes the tool up";
  EXPECT_NEAR(run->probe(1).y, force, 0.02 * force) << "the support carries it";
}

TEST(ScenarioRun, WithADepthOnlyTheQueueMoves) {
  const std::string text = R"([organ]
source = "lattice"
nodes = [3, 12, 3]
[[nodes]]
name = "top"
box_min_mm = [-10, 55, -10]
box_max_mm = [10, 55, 10]
[[force]]
set = "top"
key = [{time_s = 0, force_n = [0, 0.1, 0]}]
[run]
seconds = 0.3
depth = 2
)";
  const auto run = make(text, Solver::Live);
  ASSERT_TRUE(run);
  finish(*run);
  const auto& u = run->world().displacements;
  for (std::size_t i = 0; i < u.size(); ++i) {
    const bool is_in_reach = run->organ().mesh.rest_positions[i].y > 0.034;
    EXPECT_EQ(length(u[i]) > 0, is_in_reach) << "node " << i;
  }
}

std::string read(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

TEST(ScenarioRun, TheSameScenarioTwiceWritesTheSameBytes) {
  const auto base =
      std::filesystem::temp_directory_path() / ("trocar-scenario-" + std::to_string(::getpid()));
  for (const char* name : {"a", "b"}) {
    const auto folder = base / name;
    std::filesystem::create_directories(folder);
    const auto run = make(kColumn + R"([gravity]
m_s2 = [0, -9.81, 0]
[[displace]]
set = "top"
key = [{time_s = 0, displacement_mm = [0, 0, 0]}, {time_s = 0.1, displacement_mm = [1, 2, 3]}]
[run]
seconds = 0.2
[[probe]]
set = "top"
quantity = "reaction"
rate_hz = 1000
[[probe]]
set = "all"
quantity = "velocity"
rate_hz = 100
)",
                          Solver::Live);
    ASSERT_TRUE(run);
    auto probes = ProbeFile::create(folder / "probes.csv", run->scenario());
    ASSERT_TRUE(probes.ok());
    while (!run->is_finished()) {
      run->step();
      probes->add(*run);
    }
    ASSERT_TRUE(probes->close().ok());
    ASSERT_TRUE(write_field(folder, *run).ok());
  }
  for (const char* file : {"probes.csv", "field_0000200ms.csv", "field_0000200ms.vtu"}) {
    const auto a = read(base / "a" / file);
    EXPECT_EQ(a, read(base / "b" / file)) << file;
    EXPECT_GT(a.size(), 500u) << file;
  }
  std::istringstream lines(read(base / "a" / "probes.csv"));
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line,
            "time_s,top_reaction_x_n,top_reaction_y_n,top_reaction_z_n,all_velocity_x_mm_s,"
            "all_velocity_y_mm_s,all_velocity_z_mm_s");
  std::getline(lines, line);
  EXPECT_TRUE(line.starts_with("0.001,") && line.ends_with(",,,")) << line;
  std::filesystem::remove_all(base);
}

// An oblique cut that ends in the tissue, by each method: as in sessions, Nakao's, and Nakao's
// without moved nodes.
TEST(ScenarioRun, APapersMethodCutsInPlaceOfTheSessions) {
  std::vector<std::size_t> nodes;
  for (const char* cutting : {"", "cutting = \"nakao\"", "cutting = \"nakao-plain\""}) {
    const auto run = make(std::string(R"([organ]
source = "block"
nodes = [9, 5, 9]
spacing_mm = 5
[material]
elastic_law = "neo-hookean"
[[tool]]
radius_mm = 1
edge_mm = 30
key = [{time_s = 0, position_mm = [-30, -12, -3], shaft = [0, 1, 0], verb = "cut"},
       {time_s = 0.2, position_mm = [8, -12, 7]},
       {time_s = 0.21, position_mm = [8, -12, 7], verb = "none"}]
[run]
seconds = 0.25
self_contact = false
)") + cutting,
                          Solver::Live);
    ASSERT_TRUE(run);
    const auto mass = [&] {
      double sum = 0;
      for (const float m : run->world().masses) sum += static_cast<double>(m);
      return sum;
    };
    const double before = mass();
    finish(*run);
    EXPECT_NEAR(mass(), before, 1e-5 * before) << cutting;
    const auto& cuts = run->simulation().state().cuts;
    std::size_t moves = 0;
    for (const auto& events : cuts.history())
      for (const auto& event : events.events)
        moves += std::holds_alternative<cutting::Move>(event) ? 1 : 0;
    EXPECT_EQ(moves > 0, std::string(cutting) == "cutting = \"nakao\"") << cutting;
    const auto valid = cutting::validate(cuts.topology());
    EXPECT_TRUE(valid.ok()) << cutting;
    for (std::size_t n = 0; n < run->world().node_count(); ++n) {
      ASSERT_TRUE(is_finite(run->world().displacements[n])) << cutting << ", node " << n;
      ASSERT_EQ(run->world().rest_positions[n], to_float(cuts.topology().rest()[n])) << cutting;
    }
    nodes.push_back(run->world().node_count());
  }
  EXPECT_GT(nodes[1], nodes[0]) << "every crossed edge is split, where a session snaps";
  EXPECT_EQ(nodes[1], nodes[2]) << "moving adds none";
}

}  // namespace
}  // namespace trocar::scenario
