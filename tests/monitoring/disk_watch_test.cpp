#include "server/session/monitoring/disk_watch.h"

#include <gtest/gtest.h>

namespace trocar::monitoring {
namespace {

constexpr std::uint64_t kMB = 1'000'000;

// Samples every 5 s of a recording that grows by so many bytes per second on a disk with that room.
class Disk {
 public:
  Disk(std::uint64_t bytes_per_s, std::uint64_t room) : rate_(bytes_per_s), room_(room) {}

  // True if it was said within that time.
  bool run(double seconds) {
    bool is_said = false;
    for (const double end = at_s_ + seconds; at_s_ < end;) {
      at_s_ += 5;
      const auto grown = std::min(5 * rate_, room_);
      recorded_ += grown, room_ -= grown;
      is_said |= watch.add({at_s_, recorded_, room_});
    }
    return is_said;
  }
  void free(std::uint64_t bytes) { room_ += bytes; }
  std::uint64_t room() const { return room_; }

  DiskWatch watch;

 private:
  std::uint64_t rate_, room_, recorded_ = 0;
  double at_s_ = 0;
};

TEST(DiskWatch, SaysNothingBeforeItKnowsARate) {
  Disk disk(kMB, 10 * kMB);
  EXPECT_FALSE(disk.run(15));
  EXPECT_FALSE(disk.watch.rate());
  EXPECT_EQ(disk.watch.warning(), "");
  EXPECT_FALSE(disk.watch.must_end());
}

TEST(DiskWatch, WarnsOnceAnHourBefore) {
  Disk disk(kMB, 3700 * kMB);
  EXPECT_FALSE(disk.run(60));
  EXPECT_TRUE(disk.run(100));
  EXPECT_FALSE(disk.run(600)) << "it has been said";
  EXPECT_NEAR(*disk.watch.rate(), 1e6, 1);
  EXPECT_EQ(*disk.watch.seconds_left(), static_cast<double>(disk.room()) / 1e6);
  EXPECT_EQ(disk.watch.warning(), "the disk of the recording will be full in about 49 min");
}

TEST(DiskWatch, WarnsAgainAfterThereWasRoom) {
  Disk disk(kMB, 3000 * kMB);
  EXPECT_TRUE(disk.run(60));
  disk.free(10'000 * kMB);
  EXPECT_FALSE(disk.run(60));
  EXPECT_EQ(disk.watch.warning(), "");
  EXPECT_TRUE(disk.run(10'000));
}

TEST(DiskWatch, EndsWhileTheIndexStillFits) {
  Disk disk(kMB, 1000 * kMB);
  while (!disk.watch.must_end()) disk.run(5);
  EXPECT_GT(disk.room(), 25 * kMB) << "of a recording of a gigabyte";
  EXPECT_LT(disk.room(), 60 * kMB);
}

TEST(DiskWatch, NothingGrowsSoNothingFills) {
  Disk disk(0, kMB);
  EXPECT_FALSE(disk.run(600));
  EXPECT_EQ(*disk.watch.rate(), 0);
  EXPECT_FALSE(disk.watch.seconds_left());
  EXPECT_FALSE(disk.watch.must_end());
}

}  // namespace
}  // namespace trocar::monitoring
