// The organ in the editor's window: where a pixel meets it, and which colour its nodes have.

#include "client/editor/organ_view.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "client/editor/panel_state.h"
#include "client/render/camera.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/edit/editor.h"

namespace trocar::editor {
namespace {

constexpr render::Size kSize{800, 600};

TEST(OrganView, APixelMeetsTheSurfaceThatIsSeen) {
  const auto organ = catalogue::make_plate();
  OrganView view(organ);
  render::OrbitCamera camera;
  camera.frame({}, view.radius_m());
  const auto place = view.place_at(camera.rays(kSize), 400, 300);
  ASSERT_TRUE(place);
  EXPECT_NEAR(place->position_m.y, 0.002, 1e-4) << "the upper face of the plate";
  EXPECT_NEAR(view.normal_at(*place).y, 1, 1e-6);
  const auto seen = camera.project(to_float(place->position_m), kSize);
  ASSERT_TRUE(seen);
  EXPECT_NEAR(seen->x, 400, 1);
  EXPECT_NEAR(seen->y, 300, 1);
  EXPECT_FALSE(view.place_at(camera.rays(kSize), 2, 2));
}

TEST(OrganView, HeldNodesGoBeforeRegions) {
  edit::Editor editor(catalogue::make_plate());
  const auto& mesh = editor.organ().mesh;
  std::vector<NodeIndex> all;
  for (std::size_t i = 0; i < mesh.node_count(); ++i) all.push_back(NodeIndex(i));
  ASSERT_TRUE(editor.add_region("all", all).ok());
  OrganView view(editor.organ());
  view.colour(editor.organ());
  const auto& fixed = editor.organ().fixed_nodes;
  const auto colours = view.colours(true, true), regions = view.colours(false, true),
             held = view.colours(true, false);
  ASSERT_EQ(colours.size(), mesh.surface_nodes.size());
  std::size_t held_count = 0;
  for (std::size_t v = 0; v < colours.size(); ++v) {
    const bool is_held = std::ranges::binary_search(fixed, mesh.surface_nodes[v]);
    held_count += is_held;
    EXPECT_EQ(colours[v].owner, is_held ? kHeldColour : colour_of_part(0));
    EXPECT_EQ(regions[v].owner, colour_of_part(0));
    EXPECT_EQ(held[v].owner, is_held ? kHeldColour : render::kNoHolder);
  }
  EXPECT_GT(held_count, 0u);
  for (std::size_t r = 0; r < 20; ++r) EXPECT_NE(colour_of_part(r), kHeldColour);
}

TEST(OrganView, MovesWithTheTissueAndBack) {
  const auto organ = catalogue::make_plate();
  OrganView view(organ);
  const Vec3f up{0, 0.01f, 0};
  view.move(std::vector<Vec3f>(organ.mesh.node_count(), up));
  const auto scene = view.scene(true, true, true);
  for (std::size_t v = 0; v < scene.positions.size(); ++v)
    EXPECT_EQ(scene.positions[v], scene.rest_positions[v] + up);
  view.move({});
  const auto rest = view.scene(true, true, true);
  EXPECT_TRUE(std::ranges::equal(rest.positions, rest.rest_positions));
}

TEST(OrganView, ShowsTheFineSurfaceUnlessSomebodyPaints) {
  auto organ = catalogue::make_plate();
  EXPECT_EQ(OrganView(organ).scene(true, true, true).fine_surface, nullptr);
  organ.fine_surface.quanta = {{0, 0, 0}, {2000, 0, 0}, {0, 0, 2000}};
  organ.fine_surface.triangles = {{0, 2, 1}};
  const OrganView view(organ);
  const auto scene = view.scene(true, true, true);
  ASSERT_NE(scene.fine_surface, nullptr);
  EXPECT_EQ(*scene.fine_surface, organ.fine_surface);
  EXPECT_EQ(view.scene(true, true, true).fine_surface, scene.fine_surface) << "it is bound once";
  EXPECT_EQ(view.scene(true, true, false).fine_surface, nullptr);
  PanelState state;
  EXPECT_TRUE(state.shows_fine());
  for (const auto& [mode, shows] :
       {std::pair{Mode::Hold, false}, {Mode::Region, false}, {Mode::Press, true}}) {
    state.mode = mode;
    EXPECT_EQ(state.shows_fine(), shows);
  }
  state.wants_fine = false;
  EXPECT_FALSE(state.shows_fine());
}

}  // namespace
}  // namespace trocar::editor
