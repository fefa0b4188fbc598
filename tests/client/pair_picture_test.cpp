// Two recordings in one picture.

#include <gtest/gtest.h>

#include <cstdlib>

#include "client/app/picture.h"
#include "client/replay/paired_source.h"
#include "tests/replay/recorded_session.h"

namespace trocar::app {
namespace {

class PairPictureTest : public ::testing::Test {
 protected:
  void show(const std::string& first, const std::string& second) {
    options_.display = Display::Headless;
    options_.size = {960, 540};
    options_.overlays = {.regions = false, .arrows = false};
    auto pair = replay::PairedSource::open(first, second, replay::Alignment::Start,
                                           [this] { return now_ns_; });
    ASSERT_TRUE(pair.ok()) << pair.error().message;
    pair_ = std::move(*pair);
    auto picture = Picture::make(options_, "test");
    ASSERT_TRUE(picture.ok()) << picture.error().message;
    picture_ = std::move(*picture);
    picture_->stand_beside(options_, *pair_, second_);
  }
  void step(int count) {
    for (int i = 0; i < count; ++i) {
      now_ns_ += 16'000'000;
      pair_->poll(first_);
      pair_->poll_second(second_);
      picture_->draw(first_, *pair_, hands_, now_ns_);
    }
  }
  // How many pixels differ clearly between the halves, panels left out.
  int difference() {
    const auto image = picture_->image();
    const int half = image.size.width / 2;
    int count = 0;
    for (int y = image.size.height / 4; y < image.size.height * 7 / 10; ++y)
      for (int x = 4; x < half - 4; ++x) {
        const auto at = [&](int column) {
          return &image.rgb[static_cast<std::size_t>(y * image.size.width + column) * 3];
        };
        int most = 0;
        for (int k = 0; k < 3; ++k)
          most = std::max(most, std::abs(int{at(x)[k]} - int{at(x + half)[k]}));
        count += most > 24;
      }
    return count;
  }
  void keep(const char* name) {
    const char* folder = std::getenv("TROCAR_PICTURES");
    if (folder == nullptr) return;
    EXPECT_TRUE(picture_->save(std::string(folder) + "/" + name + ".png").ok());
  }

  replay::testing::TemporaryFolder folder_;
  ClientOptions options_;
  std::uint64_t now_ns_ = 1'000'000'000;
  std::unique_ptr<replay::PairedSource> pair_;
  replica::Replica first_{[this](const proto::Envelope& m) { return pair_->half(0).send(m); }};
  replica::Replica second_{[this](const proto::Envelope& m) { return pair_->half(1).send(m); }};
  Hands hands_;
  std::unique_ptr<Picture> picture_;
};

TEST_F(PairPictureTest, ARecordingBesideItselfIsTheSamePictureTwice) {
  const auto path = folder_.file("a.mcap");
  replay::testing::record_session(path, {.frames = 120});
  show(path, path);
  step(40);
  keep("pair");
  EXPECT_EQ(difference(), 0);
}

TEST_F(PairPictureTest, TheShorterOneStandsStillWhileTheOtherGoesOn) {
  const auto longer = folder_.file("a.mcap"), shorter = folder_.file("b.mcap");
  replay::testing::record_session(longer, {.frames = 200});
  replay::testing::record_session(shorter, {.frames = 60});
  show(longer, shorter);
  step(50);
  EXPECT_EQ(difference(), 0);
  step(90);
  EXPECT_TRUE(pair_->place(1).has_ended);
  EXPECT_GT(difference(), 20);
  keep("pair_ended");
}

}  // namespace
}  // namespace trocar::app
