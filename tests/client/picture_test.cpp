#include "client/app/picture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <string>

#include "common/base/timing.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/world/surface_layout.h"
#include "tests/client/live_device.h"
#include "tests/client/synthetic_source.h"
#include "tests/support/surface_edits.h"

// Draws without a display. Set TROCAR_PICTURES to a folder to keep the pictures and look at them.

namespace trocar::app {
namespace {

struct Pixel {
  double r = 0, g = 0, b = 0;
};

Pixel mean(const render::Image& image, int x0, int y0, int x1, int y1) {
  Pixel sum;
  for (int y = y0; y < y1; ++y)
    for (int x = x0; x < x1; ++x) {
      const std::uint8_t* p = &image.rgb[static_cast<std::size_t>((y * image.size.width + x) * 3)];
      sum.r += p[0], sum.g += p[1], sum.b += p[2];
    }
  const double count = (x1 - x0) * (y1 - y0);
  return {sum.r / count, sum.g / count, sum.b / count};
}

class PictureTest : public ::testing::Test {
 protected:
  void SetUp() override {
    options_.display = Display::Headless;
    options_.role = replica::Role::Surgeon;
    auto picture = Picture::make(options_, "test");
    // deploy/setup installs a software renderer: without one this is a failure, not a skip.
    ASSERT_TRUE(picture.ok()) << picture.error().message;
    picture_ = std::move(*picture);
  }
  void draw(int frames) {
    for (int i = 0; i < frames; ++i) {
      source_.queue_frame();
      source_.poll(replica_);
      picture_->draw(replica_, source_, hands_, now_ += 16'000'000);
    }
  }
  // How many pixels differ clearly between two pictures of the same size.
  static int difference(const render::Image& a, const render::Image& b) {
    int count = 0;
    for (std::size_t i = 0; i + 2 < a.rgb.size(); i += 3) {
      int most = 0;
      for (std::size_t k = 0; k < 3; ++k)
        most = std::max(most, std::abs(int{a.rgb[i + k]} - int{b.rgb[i + k]}));
      count += most > 24;
    }
    return count;
  }
  // The last of four pictures of the same 40 frames with these options, messages changed by
  // `tamper`.
  render::Image picture_of(const Overlays& overlays,
                           std::function<bool(proto::Envelope&)> tamper = {},
                           const char* name = nullptr) {
    options_.overlays = overlays;
    picture_.reset();  // Dear ImGui keeps one context
    auto picture = Picture::make(options_, "test");
    EXPECT_TRUE(picture.ok());
    picture_ = std::move(*picture);
    testing::SyntheticSource source(liver(), "liver");
    source.tamper = std::move(tamper);
    replica::Replica replica([&](const proto::Envelope& m) { return source.send(m); });
    source.queue_start();
    for (int i = 0; i < 40; ++i) {
      source.queue_frame();
      source.poll(replica);
      now_ += 16'000'000;
      if (i % 10 == 9) picture_->draw(replica, source, hands_, now_);
    }
    EXPECT_TRUE(replica.fault().ok());
    if (name != nullptr) keep(name);
    return picture_->image();
  }
  void keep(const char* name) {
    if (const char* folder = std::getenv("TROCAR_PICTURES")) {
      const auto saved = picture_->save(std::string(folder) + "/" + name + ".png");
      ASSERT_TRUE(saved.ok()) << saved.error().message;
    }
  }

  static wire::SurfaceLayout liver() {
    static const wire::SurfaceLayout kLayout = [] {
      auto organ = catalogue::make_liver();
      EXPECT_TRUE(organ.ok());
      return world::make_surface_layout(*organ);
    }();
    return kLayout;
  }

  ClientOptions options_;
  std::unique_ptr<Picture> picture_;
  testing::SyntheticSource source_{liver(), "liver"};
  replica::Replica replica_{[this](const proto::Envelope& m) { return source_.send(m); }};
  Hands hands_;
  std::uint64_t now_ = monotonic_ns();
};

TEST_F(PictureTest, ShowsTissueInTheMiddleAndACalmBackground) {
  source_.queue_start();
  draw(90);
  keep("liver");
  const render::Image image = picture_->image();
  ASSERT_EQ(image.size.width, 1280);
  ASSERT_EQ(image.size.height, 720);
  const Pixel tissue = mean(image, 560, 300, 640, 360);
  EXPECT_GT(tissue.r, 1.8 * tissue.g);
  EXPECT_GT(tissue.r, 60);
  const Pixel corner = mean(image, 1180, 560, 1270, 710);
  EXPECT_LT(corner.r, 60);
  EXPECT_GE(corner.b, corner.r);
  EXPECT_GT(corner.b, 4);
}

TEST_F(PictureTest, FiguresAndParticipantsAreDrawnWithoutAWindow) {
  picture_->draw(replica_, source_, hands_, now_);
  keep("empty");
  const Pixel before = mean(picture_->image(), 20, 20, 280, 240);
  source_.queue_start();
  draw(30);
  const Pixel after = mean(picture_->image(), 20, 20, 280, 240);
  EXPECT_GT(after.g, before.g + 1);  // more text in the panel
  const Pixel participants = mean(picture_->image(), 1000, 20, 1260, 110);
  EXPECT_GT(participants.g, 12);
}

TEST_F(PictureTest, OverlaysChangeWhatTheyAreFor) {
  const Overlays nothing{.regions = false, .arrows = false};
  const auto with = [&](bool Overlays::*overlay) {
    Overlays overlays = nothing;
    overlays.*overlay = true;
    return overlays;
  };
  const render::Image plain = picture_of(nothing);
  EXPECT_EQ(difference(plain, plain), 0);
  EXPECT_GT(difference(plain, picture_of(with(&Overlays::regions))), 2000);
  EXPECT_GT(difference(plain, picture_of(with(&Overlays::holds), {}, "holds")), 300);
  EXPECT_GT(difference(plain, picture_of(with(&Overlays::arrows))), 100);
  EXPECT_GT(difference(plain, picture_of(with(&Overlays::rate), {}, "rate")), 500);
}

TEST_F(PictureTest, TheForceOnOnesOwnToolIsABar) {
  const Overlays overlays;
  const auto with_force = [&](float force_n, const char* name) {
    return picture_of(
        overlays,
        [force_n](proto::Envelope& m) {
          if (m.has_welcome()) m.mutable_welcome()->set_participant(0);
          if (!m.has_frame_state()) return true;
          auto& force = *m.mutable_frame_state()->mutable_tool(0)->mutable_force_n();
          force.set_x(0), force.set_y(force_n), force.set_z(0);
          return true;
        },
        name);
  };
  const render::Image small = with_force(0.1f, "force_small"), large = with_force(1.9f, "force");
  // The right half of the bar: 0.1 of 0.5 N do not reach it, 1.9 of 2 N do.
  const Pixel without = mean(small, 230, 684, 300, 690), with = mean(large, 230, 684, 300, 690);
  EXPECT_GT(with.r + with.g + with.b, without.r + without.g + without.b + 100);
}

TEST_F(PictureTest, WhatADeviceRendersIsShownWithTheRate) {
  const Overlays rate{.regions = false, .arrows = false, .rate = true};
  const render::Image without = picture_of(rate);
  std::vector<std::unique_ptr<FeltHand>> felt;
  felt.push_back(
      std::make_unique<FeltHand>(std::make_unique<testing::LiveDevice>(), FeltSettings{}));
  hands_ = Hands::felt(std::move(felt));
  EXPECT_GT(difference(without, picture_of(rate, {}, "felt_hand")), 3000);
}

TEST_F(PictureTest, ADeviceMovesItsToolAsThePictureIsSeen) {
  options_.view = {.yaw_deg = 90, .pitch_deg = 0, .zoom = 1};
  picture_.reset();
  picture_ = std::move(*Picture::make(options_, "test"));
  auto device = std::make_unique<testing::LiveDevice>();
  device->moves = true;
  std::vector<std::unique_ptr<FeltHand>> felt;
  felt.push_back(std::make_unique<FeltHand>(std::move(device), FeltSettings{}));
  hands_ = Hands::felt(std::move(felt));
  source_.queue_start();
  draw(2);
  auto& hand = *hands_.felt().front();
  ASSERT_TRUE(hand.start({}).ok());
  Vec3d least, most;
  const auto until = monotonic_ns() + 20'000'000'000;
  while (most.z - least.z < 0.008 && monotonic_ns() < until) {
    const auto reading = hand.pop_reading(monotonic_ns());
    if (!reading) continue;
    const Vec3d& tip = reading->tip_m;
    least = {std::min(least.x, tip.x), std::min(least.y, tip.y), std::min(least.z, tip.z)};
    most = {std::max(most.x, tip.x), std::max(most.y, tip.y), std::max(most.z, tip.z)};
  }
  EXPECT_GE(most.z - least.z, 0.008) << "the right of the screen is along z";
  EXPECT_LT(most.x - least.x, 1e-4);
  EXPECT_LT(most.y - least.y, 1e-4);
}

TEST_F(PictureTest, SlowTimeIsSaidInWords) {
  const Overlays overlays;
  const render::Image plain = picture_of(overlays);
  const render::Image slow = picture_of(
      overlays,
      [](proto::Envelope& m) {
        if (!m.has_frame_state()) return true;
        m.mutable_frame_state()->mutable_rate()->set_level(proto::RATE_OVERLOADED);
        m.mutable_frame_state()->mutable_rate()->set_time_rate(0.62f);
        return true;
      },
      "slow");
  const Pixel before = mean(plain, 540, 15, 740, 65), after = mean(slow, 540, 15, 740, 65);
  EXPECT_GT(after.r, before.r + 5);  // orange words in the banner
}

TEST_F(PictureTest, ABladeIsDrawnWhereTissueLetsItBeWithALineToTheHand) {
  const Overlays overlays{.regions = false, .holds = false, .arrows = false, .rate = false};
  const auto blade = [](bool is_held_back) {
    return [is_held_back](proto::Envelope& m) {
      if (m.has_participants()) {
        auto& shape = *m.mutable_participants()->mutable_participant(1)->mutable_tool(0);
        shape.set_radius_m(0.002f), shape.set_half_width_m(0.016f), shape.set_length_m(0.07f);
      }
      if (!m.has_frame_state()) return true;
      auto& tool = *m.mutable_frame_state()->mutable_tool(1);
      if (is_held_back) {
        *tool.mutable_proxy_position_m() = tool.position_m();
        *tool.mutable_proxy_orientation() = tool.orientation();
        tool.mutable_proxy_position_m()->set_y(tool.position_m().y() + 0.02f);
      }
      return true;
    };
  };
  const render::Image straight = picture_of(overlays, blade(false), "blade");
  const render::Image held_back = picture_of(overlays, blade(true), "blade-held-back");
  EXPECT_GT(difference(straight, held_back), 1000);
}

// A slit across the front of the liver, its lips held apart by up to `open_m`.
class Slit {
 public:
  Slit(testing::SyntheticSource& source, float open_m) : open_m_(open_m) {
    const auto& layout = source.layout();
    const auto front = [&](float x, float y) {
      const auto distance = [&](const wire::QuantisedVertex& q) {
        const Vec3f p = wire::to_metres(q);
        return p.z > 0 ? (p.x - x) * (p.x - x) + (p.y - y) * (p.y - y) : 1.0f;
      };
      return VertexIndex(static_cast<std::size_t>(
          std::ranges::min_element(layout.rest_quanta, {}, distance) - layout.rest_quanta.begin()));
    };
    path_ = testing::path_between(layout, front(-0.05f, 0.026f), front(0.035f, 0.022f));
    first_new_ = layout.vertex_count();
    for (const VertexIndex v : path_)
      points_.push_back(wire::to_metres(layout.rest_quanta[v.value]));
    source.queue_change(testing::open_slit(layout, path_, {0, 0, -700}));
    source.also_move = [this](std::size_t slot, const Vec3f& rest) { return move(slot, rest); };
  }
  // The upper lip is the old one.
  Vec3f move(std::size_t slot, const Vec3f& rest) const {
    std::size_t near = 0;
    for (std::size_t i = 1; i < points_.size(); ++i)
      if (length(points_[i] - rest) < length(points_[near] - rest)) near = i;
    float side = rest.y > points_[near].y ? 1.0f : -1.0f;
    if (slot >= first_new_)
      side = (slot - first_new_) % 2 == 0 ? -1.0f : 0.0f;
    else if (path_[near].value == slot)
      side = 1;
    const float along = static_cast<float>(near) / static_cast<float>(points_.size() - 1);
    const float away = std::max(0.0f, 1 - length(points_[near] - rest) / 0.035f);
    return Vec3f{0, 0.9f, 0.3f} * (side * away * away * 4 * along * (1 - along) * open_m_);
  }
  const std::vector<Vec3f>& points() const { return points_; }

 private:
  float open_m_;
  std::vector<VertexIndex> path_;
  std::vector<Vec3f> points_;
  std::size_t first_new_ = 0;
};

TEST_F(PictureTest, ASlitShowsDarkFlesh) {
  options_.overlays = {.regions = false, .holds = false, .arrows = false, .rate = false};
  options_.view = {.yaw_deg = 0, .pitch_deg = 10, .zoom = 2};
  picture_.reset();
  picture_ = std::move(*Picture::make(options_, "test"));
  source_.queue_start();
  draw(3);
  const Slit slit(source_, 0.011f);
  draw(6);
  picture_->draw(replica_, source_, hands_, now_ += 1'000'000'000);  // the newest frame itself
  keep("slit");  // in the middle, as the view aims at it
  const render::Image image = picture_->image();
  const Pixel inside = mean(image, 470, 420, 680, 450), outside = mean(image, 470, 340, 680, 385);
  EXPECT_LT(inside.r, 0.7 * outside.r);
  EXPECT_LT(inside.g / inside.r, 0.6 * outside.g / outside.r) << "a purer red";
  int background = 0;  // seen through a crack it would be: dark and bluish
  for (int y = 300; y < 480; ++y)
    for (int x = 350; x < 850; ++x) {
      const Pixel p = mean(image, x, y, x + 1, y + 1);
      background += p.r < 40 && p.b >= p.r;
    }
  EXPECT_EQ(background, 0);
}

TEST_F(PictureTest, CuttingAtEveryFrameKeepsCameraAndPicture) {
  options_.overlays = {.regions = true, .holds = true, .arrows = false, .rate = false};
  source_.queue_start();
  draw(20);
  const render::Image before = picture_->image();
  testing::Random random(1);
  for (int i = 0; i < 12; ++i) {
    source_.queue_change(testing::random_change(source_.layout(), random));
    draw(1);
  }
  keep("cuts");
  EXPECT_EQ(replica_.counters().surface_changes, 12u);
  // Slits are closed as long as nobody pulls them open: the picture changes along some lines only.
  const int pixels = before.size.width * before.size.height;
  EXPECT_LT(difference(before, picture_->image()), pixels / 20);
}

TEST_F(PictureTest, CpuTimeOfAPictureIsReported) {
  source_.queue_start();
  draw(5);
  timespec before{}, after{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &before);
  draw(20);
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &after);
  const double ms = (static_cast<double>(after.tv_sec - before.tv_sec) * 1e3 +
                     static_cast<double>(after.tv_nsec - before.tv_nsec) * 1e-6) /
                    20;
  RecordProperty("cpu_ms_per_picture", std::to_string(ms));
  std::printf("CPU time per 1280x720 picture: %.1f ms\n", ms);
  EXPECT_EQ(picture_->count(), 25u);
}

}  // namespace
}  // namespace trocar::app
