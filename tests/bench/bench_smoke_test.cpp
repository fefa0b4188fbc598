// The benchmark program runs, and every row it writes carries a figure and a hash. Nothing here
// depends on how long anything takes.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "tests/bench/bullet_peer.h"
#include "tests/bench/our_solver.h"
#include "tests/bench/pulled_box.h"
#include "tests/bench/reference_fem.h"

namespace trocar::bench {
namespace {

namespace fs = std::filesystem;

nlohmann::json run_smoke(const std::string& name, const std::string& options = "") {
  const fs::path out = fs::path(testing::TempDir()) / ("trocar_bench_" + name);
  fs::remove_all(out);
  const std::string command = std::string(TROCAR_BINARY_DIR) + "/bench_solver --smoke " + options +
                              " --out '" + out.string() + "' >/dev/null 2>&1";
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
  std::ifstream file(out / "bench.json");
  return nlohmann::json::parse(file, nullptr, false);
}

TEST(bench_program, every_row_has_a_figure_and_a_hash) {
  const auto json = run_smoke("rows");
  ASSERT_FALSE(json.is_discarded());
  EXPECT_FALSE(json["machine"]["processor"].get<std::string>().empty());
  std::set<std::string> groups, names;
  for (const auto& row : json["rows"]) {
    const auto name = row["name"].get<std::string>();
    EXPECT_TRUE(names.insert(name).second) << name << " twice";
    groups.insert(row["group"]);
    for (const auto& [key, value] : row.items()) {
      // JSON has no infinity: what is not finite is written as null.
      EXPECT_FALSE(value.is_null()) << name << ' ' << key;
    }
    EXPECT_GT(row["median_us"].get<double>(), 0) << name;
    EXPECT_GT(row["nodes"].get<double>(), 0) << name;
    const auto hash = row["state_hash"].get<std::string>();
    EXPECT_EQ(hash.size(), 16u) << name;
    EXPECT_NE(hash, "0000000000000000") << name;
  }
  EXPECT_EQ(groups,
            (std::set<std::string>{"contacts", "graded", "nodes", "peers", "queue", "targets"}));
  // Each law of ours beside each of Bullet's.
  for (const char* peer : {"Bullet linear, implicit", "Bullet mass-spring, explicit"})
    EXPECT_TRUE(names.contains(std::string("peers/small box/") + peer));
  EXPECT_TRUE(names.contains("peers/small box/ours, springs, 4 sweeps"));
}

TEST(bench_program, equal_runs_have_equal_hashes) {
  const auto a = run_smoke("first", "--filter 'ours|targets'");
  const auto b = run_smoke("second", "--filter 'ours|targets'");
  ASSERT_FALSE(a.is_discarded() || b.is_discarded());
  ASSERT_FALSE(a["rows"].empty());
  ASSERT_EQ(a["rows"].size(), b["rows"].size());
  for (std::size_t i = 0; i < a["rows"].size(); ++i)
    EXPECT_EQ(a["rows"][i]["state_hash"], b["rows"][i]["state_hash"]) << a["rows"][i]["name"];
}

TEST(bench_program, says_what_is_wrong_with_the_command_line) {
  const auto exit_code = [](const std::string& options) {
    const std::string command =
        std::string(TROCAR_BINARY_DIR) + "/bench_solver " + options + " >/dev/null 2>&1";
    return WEXITSTATUS(std::system(command.c_str()));
  };
  EXPECT_EQ(exit_code("--help"), 0);
  EXPECT_EQ(exit_code("--smoke --list"), 0);
  EXPECT_EQ(exit_code("--no-such-option"), 2);
  EXPECT_EQ(exit_code("--smoke --filter no_such_benchmark"), 2);
}

// Node, tet and edge counts with which the figures of other libraries were published.
TEST(pulled_box, has_the_published_counts) {
  const auto counts = [](const BoxShape& shape) {
    const auto box = make_pulled_box(shape);
    const auto& mesh = box.organ.mesh;
    return std::array{mesh.node_count(), mesh.tets.size(), mesh.edges.size()};
  };
  EXPECT_EQ(counts(plate_box()), (std::array<std::size_t, 3>{1300, 3600, 6197}));
  EXPECT_EQ(counts(liver_box()), (std::array<std::size_t, 3>{4095, 16800, 22270}));
  EXPECT_EQ(counts(chest_box()), (std::array<std::size_t, 3>{17384, 72800, 95631}));
}

TEST(pulled_box, force_adds_up_and_volume_is_the_boxs) {
  const auto box = make_pulled_box(liver_box());
  double force = 0, mass = 0;
  for (const auto& f : box.forces_n) {
    force += static_cast<double>(f.x);
    EXPECT_EQ(f.y, 0);
    EXPECT_EQ(f.z, 0);
  }
  for (const auto m : box.organ.node_masses_kg) mass += m;
  EXPECT_NEAR(force, 0.05 * 10e3 * 0.14 * 0.12, 1e-4);
  EXPECT_NEAR(mass, 0.20 * 0.14 * 0.12 * 1000, 1e-9);
  EXPECT_EQ(box.loaded_nodes.size(), 15u * 13u);
}

// The published static answers of linear elasticity on these meshes, by another program.
TEST(reference_fem, gives_the_published_static_displacements) {
  EXPECT_NEAR(ReferenceFem(make_pulled_box(plate_box())).static_displacement(), 7.761e-3, 1e-6);
  EXPECT_NEAR(ReferenceFem(make_pulled_box(liver_box())).static_displacement(), 9.618e-3, 1e-6);
}

// Two independent solvers of one problem, one of them in float with its own tolerance.
TEST(bullet_peer, agrees_with_the_reference_on_linear_tets) {
  const auto box = make_pulled_box({"small box", {6, 3, 3}, {0.06, 0.03, 0.03}});
  BulletPeer peer(box, BulletLaw::Linear, true, 1e-3);
  for (int i = 0; i < 100; ++i) peer.step();
  const double expected = ReferenceFem(box).displacement_after(100, 1e-3);
  EXPECT_NEAR(peer.face_displacement(), expected, 0.005 * expected);
  EXPECT_GT(expected, 1e-3);
}

TEST(our_solver, more_sweeps_come_nearer_to_convergence) {
  const auto box = make_pulled_box({"small box", {6, 3, 3}, {0.06, 0.03, 0.03}});
  const auto face = [&](std::uint32_t sweeps) {
    OurSolver solver(box.organ, {.sweeps = sweeps});
    for (int i = 0; i < 100; ++i) solver.step(box.forces_n);
    return box.face_displacement(
        [&](NodeIndex node) { return static_cast<double>(solver.displacements()[node.value].x); });
  };
  const double converged = face(40);
  EXPECT_NEAR(face(4), converged, 0.01 * converged);
  EXPECT_LT(std::abs(face(12) - converged), 1e-4 * converged);
}

}  // namespace
}  // namespace trocar::bench
