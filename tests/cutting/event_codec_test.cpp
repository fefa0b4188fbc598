// Cut events as bytes.

#include "server/tissue/cutting/event_codec.h"

#include <gtest/gtest.h>

#include "server/organs/catalogue/load_organ.h"
#include "tests/cutting/random_strokes.h"
#include "tests/support/shared.h"

namespace trocar::cutting::testing {
namespace {

TEST(EventCodec, BytesOfEachKind) {
  const CutEvents events{
      {Split{NodeIndex(300u), NodeIndex(298u), 0x1234, NodeIndex(1000u)}, Open{0, 2},
       Duplicate{NodeIndex(298u), NodeIndex(1001u)}, Move{NodeIndex(70u), NodeIndex(72u), 0x0105}},
      {{TetIndex(5u), 1}, {TetIndex(6u), 0}}};
  Bytes bytes;
  encode(events, bytes);
  const Bytes expected{1 << 2 | 0, 0xd8, 0x04, 3, 0x34, 0x12, 0xd0, 0x0f,  //
                       1 << 2 | 1, 2,    42,   6,                          //
                       1 << 2 | 2, 0xd4, 0x04, 2,                          //
                       1 << 2 | 3, 0x8c, 0x01, 4, 5,    1};
  EXPECT_EQ(bytes, expected);
  EXPECT_EQ(decode(bytes), events);
  EXPECT_EQ(decode({}), CutEvents{});
}

TEST(EventCodec, HistoriesComeBackAndAreSmall) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/liver_coarse.msh");
  const auto path = trocar::testing::shared_folder() / "organs/liver_coarse.msh";
  CutOrgan liver(*catalogue::load_organ(path.string()));
  RandomStrokes strokes(liver.organ(), liver.cutter().mean_h(), 1);
  for (int cut = 0; cut < 8; ++cut) liver.stroke(strokes.next(StrokeKind::Knife));
  Bytes bytes;
  auto writing = world::StateArchive::writing(bytes);
  auto events = liver.history();
  visit_state(writing, events);
  const double per_tet = double(bytes.size()) / liver.total().crossed_tets;
  RecordProperty("bytes_per_cut_tet", std::to_string(per_tet));
  EXPECT_LT(per_tet, 8);
  CutEvents read;
  auto reading = world::StateArchive::reading(bytes);
  visit_state(reading, read);
  EXPECT_TRUE(reading.ok() && reading.at_end());
  EXPECT_EQ(read, liver.history());
}

TEST(EventCodec, WhatIsNoEncodingIsRefusedAndNoneBreaksATopology) {
  const auto organ = box_organ(4, 4, 4, 0.01);
  CutOrgan box(organ);
  box.stroke(straight_path({{0.003, -0.06, -0.06}, {0.003, -0.06, 0.06}},
                           {{0.003, 0.06, -0.06}, {0.003, 0.06, 0.06}}, 0.002));
  Bytes bytes;
  encode(box.history(), bytes);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const auto part = decode(BytesView(bytes).first(size));
    EXPECT_TRUE(!part || part->events.size() < box.history().events.size());
  }
  EXPECT_FALSE(decode(Bytes{1 << 2 | 3}));                                     // and no more
  EXPECT_FALSE(decode(Bytes{1 << 2, 1, 0, 0, 0, 0}));                          // node -1
  EXPECT_FALSE(decode(Bytes{1 << 2, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 1}));  // too long
  EXPECT_FALSE(decode(Bytes{0xfe, 0xff, 0xff, 0xff, 0xff, 0x7f}));             // longer than it is
  trocar::testing::Random random(1);
  for (int i = 0; i < 300; ++i) {
    auto changed = bytes;
    changed[random.below(static_cast<std::uint32_t>(changed.size()))] =
        static_cast<std::uint8_t>(random.below(256));
    const auto events = decode(changed);
    if (!events) continue;
    topology::Topology topology(organ);
    Places places(topology);
    const auto status = apply(*events, topology, places);
    const double volume = total_volume(box.topology());
    EXPECT_NEAR(total_volume(topology), volume, 1e-9 * volume) << i << status.ok();
  }
}

}  // namespace
}  // namespace trocar::cutting::testing
