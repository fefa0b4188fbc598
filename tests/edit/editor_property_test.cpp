// Random edits and undos: the way back gives the first state to the bit, the way forth the last
// one, and every state between is an organ.

#include <gtest/gtest.h>

#include <random>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/edit/editor.h"
#include "server/organs/edit/surface_brush.h"

namespace trocar::edit {
namespace {

class RandomHand {
 public:
  RandomHand(Editor& editor, unsigned seed)
      : editor_(editor), brush_(editor.organ().mesh), random_(seed) {}

  void do_something() {
    switch (below(12)) {
      case 0:
      case 1:
        editor_.hold(some_nodes());
        break;
      case 2:
        editor_.release(some_nodes());
        break;
      case 3:
        (void)editor_.add_region("region " + std::to_string(below(6)), some_nodes()).ok();
        break;
      case 4:
        editor_.add_to_region(below(4), some_nodes());
        break;
      case 5:
        editor_.take_from_region(below(4), some_nodes());
        break;
      case 6:
        editor_.raise_region(below(4));
        break;
      case 7:
        editor_.remove_region(below(8));
        break;
      case 8:
        (void)editor_.use_measured(some_part(), material::measured_materials().front()).ok();
        break;
      case 9:
        (void)editor_.use_neo_hookean(some_part(), 1000.0 * static_cast<double>(below(20)), 0.4)
            .ok();
        break;
      case 10:
        editor_.undo();
        break;
      default:
        below(2) == 0 ? editor_.begin_stroke() : editor_.end_stroke();
    }
  }

 private:
  std::size_t below(std::size_t limit) { return random_() % limit; }
  Part some_part() { return below(2) == 0 ? Part{} : Part{below(3)}; }
  std::vector<NodeIndex> some_nodes() {
    const auto& mesh = editor_.organ().mesh;
    const auto triangle = static_cast<std::uint32_t>(below(mesh.boundary_triangles.size()));
    const auto corner = mesh.boundary_triangles[triangle][0];
    return brush_.nodes_below({triangle, mesh.rest_positions[corner.value]},
                              0.001 * static_cast<double>(below(60)),
                              0.001 * static_cast<double>(below(60)));
  }

  Editor& editor_;
  SurfaceBrush brush_;
  std::mt19937 random_;
};

TEST(EditorProperty, TheWayBackGivesTheFirstState) {
  const auto first = *catalogue::make_liver(1000);
  for (unsigned seed = 1; seed <= 12; ++seed) {
    Editor editor(first);
    RandomHand hand(editor, seed);
    for (int i = 0; i < 120; ++i) {
      hand.do_something();
      const auto valid = organ::validate(editor.organ());
      ASSERT_TRUE(valid.ok()) << "seed " << seed << ", edit " << i << ": " << valid.error().message;
    }
    editor.end_stroke();
    const auto last = editor.organ();
    std::size_t steps = 0;
    while (editor.undo()) ++steps;
    EXPECT_EQ(editor.organ(), first) << "seed " << seed;
    EXPECT_FALSE(editor.has_unsaved_changes());
    // The way forth leaves out what was undone before the last edit.
    for (std::size_t i = 0; i < steps; ++i) EXPECT_TRUE(editor.redo());
    EXPECT_EQ(editor.organ(), last) << "seed " << seed;
  }
}

}  // namespace
}  // namespace trocar::edit
