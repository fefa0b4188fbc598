// The campaign of cuts in short: the same laws over some hundred cuts; that a series can be done
// again; what sawing and wild strokes without end add.

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "server/organs/catalogue/load_organ.h"
#include "tests/cutting/campaign_table.h"
#include "tests/support/shared.h"

namespace trocar::cutting::testing {
namespace {

void run(const organ::Organ& organ, const std::string& name, std::uint64_t number,
         const CampaignOptions& options, CampaignTable& table) {
  Series series(organ, name, number, options);
  while (!series.is_over()) {
    const auto record = series.next();
    table.add(record);
    ASSERT_EQ(record.broken, "") << name << " " << number << " " << record.cut;
  }
}

void run_short(const organ::Organ& organ, const std::string& name) {
  CampaignTable table;
  CampaignOptions options;
  options.longest = 30;
  for (const std::uint64_t number : {1, 2, 3, 4, 5}) run(organ, name, number, options, table);
  EXPECT_GE(table.cuts(), 60u);
  for (const auto& law : table.broken_laws()) ADD_FAILURE() << law << "\n" << table.text();
}

TEST(ShortCampaign, LawsHoldInABox) {
  run_short(box_organ(6, 6, 6, 0.01), "box");
}
TEST(ShortCampaign, LawsHoldInARegularBox) {
  run_short(box_organ(6, 6, 6, 0.01, 0), "regular");
}
TEST(ShortCampaign, LawsHoldInASlab) {
  run_short(box_organ(12, 2, 12, 0.005), "slab");
}
TEST(ShortCampaign, LawsHoldInALiver) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/liver_tiny.msh");
  const auto path = trocar::testing::shared_folder() / "organs/liver_tiny.msh";
  run_short(*catalogue::load_organ(path.string()), "liver");
}

TEST(ShortCampaign, ASeriesCanBeDoneAgainAndReadBack) {
  CampaignOptions options;
  options.longest = 12;
  const auto organ = box_organ(5, 5, 5, 0.01);
  std::string texts[2];
  const auto file = std::filesystem::path(::testing::TempDir()) / "campaign_test.csv";
  for (auto& text : texts) {
    Series series(organ, "box", 9, options);
    text = csv_header();
    while (!series.is_over()) {
      auto record = series.next();
      record.cpu_ms = record.worst_ms = 0;
      text += csv_line(record);
    }
  }
  EXPECT_EQ(texts[0], texts[1]);
  std::ofstream(file) << texts[0] << "box,9,a line that was cut sh";
  CampaignTable table;
  ASSERT_TRUE(table.read(file).ok());
  EXPECT_EQ(table.cuts(), series_length(9, options));
  EXPECT_TRUE(table.has_series("box", 9));
  EXPECT_FALSE(table.has_series("box", 8));
  std::filesystem::remove(file);
}

// Tets that were added.
struct Sawn {
  std::size_t after_1_s = 0, after_10_s = 0;
  std::size_t in_the_end = 0;  // with what is repaired when the blade has left
};

// 1 mm to and fro at 5 Hz, with a noise of 0.05 mm across.
Sawn saw(const Vec3d& centre, const Vec3d& edge, const Vec3d& motion, double length_m,
         trocar::testing::Random& random) {
  CutOrgan box(box_organ(4, 4, 4, 0.01));
  const auto tets = [&] { return find_pieces(box.topology()).piece_of_tet.size(); };
  const auto before = tets();
  const Vec3d aside = cross(edge, motion);
  Sawn sawn;
  for (int tick = 0; tick < 10'000; ++tick) {
    const int phase = tick % 200;
    const Vec3d at = centre + motion * ((phase < 100 ? phase : 200 - phase) * 1e-5 - 0.0005) +
                     aside * random.between(-5e-5, 5e-5);
    EXPECT_TRUE(box.cutter().move(0, Edge{at - edge * (length_m / 2), at + edge * (length_m / 2)}));
    box.tick();
    if (tick == 999) sawn.after_1_s = tets() - before;
  }
  sawn.after_10_s = tets() - before;
  box.cutter().lift(0);
  box.run_until_idle();
  EXPECT_EQ(box.check(), "");
  sawn.in_the_end = tets() - before;
  return sawn;
}

TEST(Sawing, OneMillimetreInOneTetForTenSecondsAddsFewTets) {
  trocar::testing::Random random(11);
  const auto any = [&](double size) {
    return Vec3d{random.between(-size, size), random.between(-size, size),
                 random.between(-size, size)};
  };
  std::size_t most_short = 0, most_long = 0, most_later = 0;
  for (int place = 0; place < 12; ++place) {
    const Vec3d edge = normalized(any(1), {1, 0, 0});
    const Vec3d motion = normalized(cross(edge, any(1)), {0, 1, 0});
    // Shorter than a tet is wide, or through three of them.
    const bool is_short = place % 2 == 0;
    const auto sawn = saw(any(0.01), edge, motion, is_short ? 0.002 : 0.03, random);
    auto& most = is_short ? most_short : most_long;
    most = std::max(most, sawn.in_the_end);
    most_later = std::max(most_later, sawn.after_10_s - sawn.after_1_s);
  }
  EXPECT_LE(most_short, 40u);
  EXPECT_LE(most_long, 110u);
  EXPECT_LE(most_later, 10u);
}

TEST(WildStrokes, WithoutEndLevelOff) {
  CampaignOptions options;
  options.shortest = options.longest = 600;
  options.check_every = 100;
  options.compares = false;
  Series series(box_organ(2, 2, 2, 0.01), "box", 1, options);
  std::vector<CutRecord> records;
  while (!series.is_over()) {
    records.push_back(series.next());
    ASSERT_EQ(records.back().broken, "") << records.back().cut;
  }
  const auto &half = records[299], &all = records[599];
  EXPECT_LE(double(all.tets), 1.1 * double(half.tets));
  EXPECT_LE(double(all.nodes), 1.1 * double(half.nodes));
  EXPECT_LE(double(all.bytes), 1.1 * double(half.bytes));
  EXPECT_LE(all.pieces, 40u);  // of 0.25 h^3 or more
}

}  // namespace
}  // namespace trocar::cutting::testing
