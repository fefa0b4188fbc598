// The figures of the editor's panel are in the units that people read.

#include "client/editor/panel_state.h"

#include <gtest/gtest.h>

#include "server/organs/catalogue/builtin_organs.h"

namespace trocar::editor {
namespace {

// The plate is of 160 x 4 x 160 mm, so of 102.4 ml, and 900 kg/m^3.
TEST(PanelState, SaysSizeVolumeAndMassInHandyUnits) {
  edit::Editor editor(catalogue::make_plate());
  const auto figures = figures_of(editor);
  const auto value = [&](const std::string& name) {
    for (const auto& [key, text] : figures.rows)
      if (key == name) return text;
    return std::string("missing");
  };
  EXPECT_EQ(value("size"), "160.0 x 4.0 x 160.0 mm");
  EXPECT_EQ(value("volume"), "102.4 ml");
  EXPECT_EQ(value("mass"), "92.16 g");
  EXPECT_EQ(value("tets"), std::to_string(editor.organ().mesh.tets.size()));
  EXPECT_EQ(figures.part_materials, std::vector<std::string>{"springs, 100 N/m"});
  ASSERT_TRUE(editor.use_neo_hookean({}, 4000, 0.45).ok());
  EXPECT_EQ(figures_of(editor).part_materials[0], "neo-Hookean, 4 kPa");
}

TEST(PanelState, TheBoxIsInMillimetres) {
  PanelState state;
  state.low_mm = {-10, -20, -30};
  state.high_mm = {10, 20, 30};
  const auto box = state.box();
  EXPECT_NEAR(box.low_m.y, -0.020, 1e-9);
  EXPECT_NEAR(box.high_m.z, 0.030, 1e-9);
  EXPECT_TRUE(box.is_on_surface);
  state.mode = Mode::Region;
  EXPECT_FALSE(state.box().is_on_surface) << "a region needs whole tets";
}

}  // namespace
}  // namespace trocar::editor
