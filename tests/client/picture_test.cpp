#include "client/app/picture.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "common/base/timing.h"
#include "common/scene/builtin_organs.h"
#include "tests/client/synthetic_source.h"

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
  void keep(const char* name) {
    if (const char* folder = std::getenv("TROCAR_PICTURES")) {
      const auto saved = picture_->save(std::string(folder) + "/" + name + ".png");
      ASSERT_TRUE(saved.ok()) << saved.error().message;
    }
  }

  static wire::SurfaceLayout liver() {
    auto organ = scene::make_liver();
    EXPECT_TRUE(organ.ok());
    return wire::make_surface_layout(*organ);
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
