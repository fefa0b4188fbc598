// A pane lets a click take the place under the pointer, to measure from it.

#include "client/app/pane.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "client/device/ray_pick.h"
#include "client/shape/clear_eye.h"
#include "common/base/timing.h"
#include "tests/client/synthetic_source.h"
#include "tests/support/surface_edits.h"

namespace trocar::app {
namespace {

class PaneTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto context = render::make_headless_context({640, 360});
    ASSERT_TRUE(context.ok()) << context.error().message;
    context_ = std::move(*context);
    pane_.emplace(*context_, "");
    source_.queue_start();
    step(20);
  }
  // Returns the place that is seen at this pixel.
  Vec3f seen_at(float x, float y) const {
    const auto view = pane_->camera().rays(pane_->size());
    const Vec3f ray = view.ray_through(x, y);
    const auto t =
        device::pick(pane_->surface().positions(), replica_.topology().triangles, view.eye, ray);
    EXPECT_TRUE(t);
    return view.eye + ray * t.value_or(0);
  }
  void step(int frames) {
    for (int i = 0; i < frames; ++i) {
      source_.queue_frame();
      source_.poll(replica_);
      pane_->observe(replica_);
      pane_->update(replica_, view_, now_ += 16'000'000);
      pane_->make_scene(replica_, hands_, {overlays_, 0.016f, false});
    }
  }

  StartView view_;
  std::unique_ptr<render::GlContext> context_;
  std::optional<Pane> pane_;
  testing::SyntheticSource source_{testing::make_blob_layout(24, 32, 0.05), "blob"};
  replica::Replica replica_{[this](const proto::Envelope& m) { return source_.send(m); }};
  Hands hands_;
  Overlays overlays_;
  std::uint64_t now_ = monotonic_ns();
};

TEST_F(PaneTest, AClickTakesThePlaceUnderThePointer) {
  EXPECT_FALSE(pane_->measure_at(replica_, 2, 2)) << "there is no tissue";
  ASSERT_TRUE(pane_->measure_at(replica_, 280, 180));
  ASSERT_TRUE(pane_->measure_at(replica_, 350, 200));
  step(1);
  const auto ruler = pane_->ruler();
  ASSERT_EQ(ruler.ends.size(), 2u);
  // The tissue moves by less than this in a frame.
  EXPECT_NEAR(ruler.ends[0].x, 280, 4);
  EXPECT_NEAR(ruler.ends[0].y, 180, 4);
  EXPECT_NEAR(ruler.ends[1].x, 350, 4);
  EXPECT_NEAR(ruler.ends[1].y, 200, 4);
  char text[32];
  std::snprintf(text, sizeof text, "%.1f mm",
                static_cast<double>(pane_->measured().distance_m().value()) * 1e3);
  EXPECT_EQ(ruler.text, text);
  EXPECT_LE(*pane_->measured().distance_m(), 0.11f) << "no more than the blob is wide";
}

TEST_F(PaneTest, CutsKeepWhatIsMeasured) {
  ASSERT_TRUE(pane_->measure_at(replica_, 280, 180));
  ASSERT_TRUE(pane_->measure_at(replica_, 350, 200));
  step(1);
  testing::Random random(7);
  for (int i = 0; i < 12; ++i) {
    source_.queue_change(testing::random_change(source_.layout(), random));
    step(2);
    for (const auto& place : pane_->measured().positions()) EXPECT_TRUE(place) << i;
  }
  EXPECT_EQ(pane_->ruler().ends.size(), 2u);
}

TEST_F(PaneTest, ZoomsAboutWhatIsUnderThePointer) {
  const Vec3f place = seen_at(370, 150);
  const float before = length(place - pane_->camera().rays(pane_->size()).eye);
  for (int i = 0; i < 12; ++i)
    pane_->move_camera(replica_, {.x = 370, .y = 150, .wheel = 1, .control = true}, 0.016f);
  const float after = length(place - pane_->camera().rays(pane_->size()).eye);
  EXPECT_NEAR(after / before, std::pow(0.9f, 12), 0.03f);
  const auto at = pane_->camera().project(place, pane_->size());
  ASSERT_TRUE(at);
  EXPECT_NEAR(at->x, 370, 1);
  EXPECT_NEAR(at->y, 150, 1);
}

TEST_F(PaneTest, AViewThatStartsNearLooksAtTheWoundUntilItIsMoved) {
  view_.zoom = 2;
  pane_->frame_camera(replica_, view_);
  const Vec3f middle = pane_->camera().centre();
  testing::Random random(7);
  for (int i = 0; i < 4; ++i) {
    source_.queue_change(testing::random_change(source_.layout(), random));
    step(2);
  }
  step(200);
  ASSERT_TRUE(std::ranges::count(replica_.topology().is_wound, 1) > 0);
  const Vec3f wound = pane_->camera().centre();
  EXPECT_GT(length(wound - middle), 0.003f);
  pane_->move_camera(replica_, {.dx = 20, .middle = true}, 0.016f);
  const Vec3f moved = pane_->camera().centre();
  EXPECT_GT(length(moved - wound), 1e-4f);
  step(20);
  EXPECT_EQ(pane_->camera().centre(), moved);
}

TEST_F(PaneTest, AnEyeInTheTissueStepsOut) {
  pane_->camera().look({0, 0, 0.001f}, {0, 0, 0});
  step(1);
  const auto view = pane_->camera().rays(pane_->size());
  for (const Vec3f& p : pane_->surface().positions())
    EXPECT_GE(length(view.eye - p), shape::kClearMetres);
  EXPECT_GT(length(view.eye), 0.04f);
}

TEST_F(PaneTest, FewerPixelsShowTheSameOrganInTheSamePlace) {
  const auto redness = [&](float fineness) {
    pane_->set_fineness(fineness);
    pane_->draw(render::Quality::Live);
    const auto image = context_->read_image();
    std::vector<int> columns(64);
    for (std::size_t i = 0; i < image.rgb.size(); i += 3)
      columns[i / 3 % 640 / 10] += int{image.rgb[i]} - int{image.rgb[i + 1]};
    return columns;
  };
  const auto fine = redness(1), coarse = redness(0.5f);
  const int most = std::ranges::max(fine);
  EXPECT_GT(most, 0);
  EXPECT_NE(fine, coarse);
  for (std::size_t i = 0; i < fine.size(); ++i) EXPECT_NEAR(fine[i], coarse[i], 0.1 * most) << i;
}

}  // namespace
}  // namespace trocar::app
