// Operations of deploy/scenes, played to a session as a client plays them.

#include <gtest/gtest.h>

#include "common/tool/script.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/cutting/validate.h"
#include "server/tissue/step/simulation.h"

namespace trocar::step {
namespace {

// One hand, its tools from a script.
class Operation {
 public:
  Operation(organ::Organ organ, const char* script) : simulation_(std::move(organ)) {
    const std::string folder = TROCAR_SOURCE_DIR "/deploy/scenes/";
    auto parsed = tool::parse_script(folder + script);
    EXPECT_TRUE(parsed.ok());
    script_ = std::move(*parsed);
    const auto& mesh = simulation_.organ().mesh;
    std::vector<Vec3f> rest;
    for (const auto& p : mesh.rest_positions) rest.push_back(to_float(p));
    std::vector<tool::SurfaceTriangle> triangles;
    for (const auto& [a, b, c] : mesh.boundary_triangles)
      triangles.push_back({a.value, b.value, c.value});
    for (const auto& tool : script_.tools)
      anchors_.push_back(tool.anchor ? *tool::find_anchor(*tool.anchor, rest, triangles)
                                     : tool::AnchorPoint{});
  }

  // Up to this time of the script; a sample per 8 ms.
  void run_to(double seconds) {
    while (static_cast<double>(simulation_.current_tick()) < seconds * 1e3) {
      const Tick tick = simulation_.current_tick() + 1;
      hands::TickInputs inputs;
      if (tick == 1) {
        hands::HandJoin join{.slot = {0}, .tool_count = static_cast<int>(script_.tools.size())};
        for (std::size_t t = 0; t < script_.tools.size(); ++t)
          join.shapes[t] = script_.tools[t].shape;
        inputs.joins.push_back(join);
      }
      for (std::size_t t = 0; t < script_.tools.size() && tick % 8 == 1; ++t)
        inputs.samples.push_back(
            {tool_slot({0}, static_cast<int>(t)),
             tool::sample(script_.tools[t], static_cast<double>(tick) * 1e-3, anchors_[t])});
      const auto report = simulation_.tick(inputs, {});
      ASSERT_EQ(report.solve.nodes_rejected, 0u) << "tick " << tick;
      simulation_.pop_frame();
      opened_m2 += report.cut.opened_area_m2 - report.cut.torn_area_m2;
      torn_m2 += report.cut.torn_area_m2;
    }
  }

  const State& state() const { return simulation_.state(); }
  // Tets of each piece, most first.
  std::vector<std::size_t> pieces() const {
    const auto found = cutting::find_pieces(state().cuts.topology());
    std::vector<std::size_t> sizes(found.count);
    for (std::uint32_t t = 0; t < state().cuts.topology().tet_count(); ++t)
      if (state().cuts.topology().has_tet(TetIndex(t))) ++sizes[found.piece_of_tet[t]];
    std::sort(sizes.rbegin(), sizes.rend());
    return sizes;
  }
  // Mean displacement of what the second tool holds.
  Vec3f held_has_moved() const {
    const auto& nodes = state().grasps[ToolSlot{1}].nodes;
    Vec3f sum;
    for (const auto node : nodes) sum += state().world.displacements[node.value];
    return nodes.empty() ? Vec3f{} : sum / static_cast<float>(nodes.size());
  }
  // How far that node has gone which has gone least, of the piece that the second tool holds.
  float piece_has_moved() const {
    const auto& topology = state().cuts.topology();
    const auto found = cutting::find_pieces(topology);
    const auto piece_of = [&](NodeIndex node) {
      return found.piece_of_tet[topology.tets_of(node).front().value];
    };
    const auto held = piece_of(state().grasps[ToolSlot{1}].nodes.front());
    float least = 1;
    for (std::uint32_t n = 0; n < topology.node_count(); ++n)
      if (!topology.tets_of(NodeIndex(n)).empty() && piece_of(NodeIndex(n)) == held)
        least = std::min(least, length(state().world.displacements[n]));
    return least;
  }
  bool is_valid() const { return cutting::validate(state().cuts.topology()).ok(); }

  double opened_m2 = 0, torn_m2 = 0;

 private:
  Simulation simulation_;
  tool::Script script_;
  std::vector<tool::AnchorPoint> anchors_;
};

TEST(Scenes, AFlapIsCutOnThreeSidesLiftedAndTornOff) {
  auto organ = catalogue::make_plate();
  organ.material.tear_stretch = 1.6;
  Operation flap(std::move(organ), "flap.toml");
  flap.run_to(2.8);
  EXPECT_NEAR(flap.opened_m2, 0.144 * 0.004, 0.15 * 0.144 * 0.004) << "three sides, 14 cm";
  EXPECT_EQ(flap.pieces().size(), 1u);
  flap.run_to(4.6);
  EXPECT_EQ(flap.pieces().size(), 1u) << "it hangs on its fourth side";
  EXPECT_GT(flap.held_has_moved().y, 0.018f);
  EXPECT_LT(flap.torn_m2, 2e-5);
  flap.run_to(6.5);
  EXPECT_TRUE(flap.is_valid());
  EXPECT_GT(flap.torn_m2, 0.8 * 0.022 * 0.004) << "over the fourth side, 2 cm";
  const auto pieces = flap.pieces();
  ASSERT_GE(pieces.size(), 2u);
  EXPECT_GT(pieces[1], 150u) << "the flap in one piece, or nearly";
  ASSERT_FALSE(flap.state().grasps[ToolSlot{1}].nodes.empty());
  EXPECT_GT(flap.held_has_moved().y, 0.09f);
  EXPECT_GT(flap.piece_has_moved(), 0.05f);
}

TEST(Scenes, AWedgeIsCutOutAndRemoved) {
  Operation wedge(*catalogue::make_liver(8000), "wedge.toml");
  wedge.run_to(2.5);
  EXPECT_EQ(wedge.pieces().size(), 1u) << "one side of two";
  wedge.run_to(5.3);
  const auto pieces = wedge.pieces();
  ASSERT_GE(pieces.size(), 2u);
  EXPECT_GT(pieces[1], 100u);
  wedge.run_to(7.5);
  EXPECT_TRUE(wedge.is_valid());
  EXPECT_EQ(wedge.torn_m2, 0);
  ASSERT_FALSE(wedge.state().grasps[ToolSlot{1}].nodes.empty());
  EXPECT_GT(wedge.held_has_moved().z, 0.04f);
  EXPECT_GT(wedge.piece_has_moved(), 0.03f);
}

}  // namespace
}  // namespace trocar::step
