// Organs from meshes and surfaces of other programs, in sessions of the real programs: they are
// imported, run under a hand for a while, and their recordings verify.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "server/organs/organ/organ_file.h"
#include "tests/e2e/programs.h"
#include "tests/support/shared.h"

namespace trocar::e2e {
namespace {

// Presses 8 mm into the organ's highest node from above, and lets go.
std::filesystem::path press_script(const std::filesystem::path& folder, const organ::Organ& organ) {
  const Vec3d top = 1e3 * *std::ranges::max_element(organ.mesh.rest_positions, {}, &Vec3d::y);
  const auto path = folder / "press.toml";
  std::ofstream script(path);
  script << "[[tool]]\nradius_mm = 8\nedge_mm = 10\n";
  const auto key = [&](double time_s, double height_mm, const char* verb) {
    script << "[[tool.key]]\ntime_s = " << time_s << "\nposition_mm = [" << top.x << ", "
           << top.y + height_mm << ", " << top.z << "]\nshaft = [0, 1, 0]\nverb = \"" << verb
           << "\"\n";
  };
  key(0, 20, "none");
  key(0.5, 4, "push");
  key(1.5, -8, "push");
  key(2.2, -8, "push");
  key(2.6, 20, "none");
  return path;
}

void expect_session(const std::vector<std::string>& import_arguments) {
  const auto folder = test_folder();
  const auto path = folder / "imported.organ";
  std::vector<std::string> arguments{"import"};
  arguments.insert(arguments.end(), import_arguments.begin(), import_arguments.end());
  arguments.insert(arguments.end(), {"--out", path.string()});
  Program import("trocar-organ", arguments, folder / "import.log");
  ASSERT_EQ(import.wait(120), 0) << read_text(folder / "import.log");
  const auto organ = organ::read_organ(path);
  ASSERT_TRUE(organ.ok()) << organ.error().message;
  Session session(path.string(), at_pace(1, {"--seconds", "4"}));
  auto hand = session.hand("Ada", press_script(folder, *organ));
  EXPECT_EQ(session.server().wait(120), 0);
  EXPECT_NE(hand.wait(60), -1);
  EXPECT_GT(json_number(session.summary_of("Ada"), "changed_vertices"), 0)
      << "the hand has moved nothing";
  Program verify("trocar-journal", {"verify", session.journal.string()}, folder / "verify.log");
  EXPECT_EQ(verify.wait(120), 0) << read_text(folder / "verify.log");
}

TEST(ImportedSession, OfATetMeshVerifies) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/liver_tiny.vtk");
  expect_session({(trocar::testing::shared_folder() / "organs/liver_tiny.vtk").string()});
}

// It rides on the mesh that is made from it.
TEST(ImportedSession, OfASurfaceVerifies) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/stomach_surface_mm.stl");
  const auto file = (trocar::testing::shared_folder() / "organs/stomach_surface_mm.stl").string();
  expect_session({file, "--unit", "mm", "--nodes", "1000", "--embed", file});
}

TEST(ImportedSession, OfALiverUnderItsOwnSurfaceVerifies) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/liver_surface_mm.stl");
  const auto file = (trocar::testing::shared_folder() / "organs/liver_surface_mm.stl").string();
  expect_session({file, "--unit", "mm", "--nodes", "1500", "--embed", file});
}

// A block of 40 mm that the test writes itself.
TEST(ImportedSession, OfAWrittenSurfaceVerifies) {
  const auto path = test_folder() / "block.obj";
  std::ofstream file(path);
  for (int i = 0; i < 8; ++i)
    file << "v " << 40 * (i & 1) << " " << 40 * (i >> 1 & 1) << " " << 40 * (i >> 2) << "\n";
  file << "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
  file.close();
  expect_session({path.string(), "--unit", "mm", "--nodes", "500"});
}

}  // namespace
}  // namespace trocar::e2e
