// Laws of a session's blood on an organ that is being cut: nothing is lost, and equal frames give
// equal blood, however they are reached.

#include "server/session/bleeding/bleeding.h"

#include <gtest/gtest.h>

#include <optional>

#include "tests/bleeding/cut_liver.h"

namespace trocar::bleeding {
namespace {

using testing::cut_liver;

Bytes state_of(Bleeding& bleeding) {
  Bytes bytes;
  bleeding.write_state(bytes);
  return bytes;
}

TEST(Bleeding, NothingIsLostWhateverIsCut) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    Bleeding bleeding(Rules{});
    std::int64_t most = 0;
    cut_liver(seed, 3000, [&](step::PublishedFrame& frame, step::Simulation& simulation) {
      bleeding.observe(frame, simulation.layout(), simulation.state().tools);
      const auto& blood = bleeding.blood();
      ASSERT_EQ(blood.volume_pl.size(), simulation.layout().vertex_count());
      ASSERT_EQ(blood.shed_pl, blood.on_surface_pl() + blood.dripped_pl + blood.sucked_pl)
          << "seed " << seed << ", frame " << frame.frame;
      for (const auto pl : blood.volume_pl) ASSERT_GE(pl, 0);
      ASSERT_GE(blood.shed_pl, most) << "blood does not run back";
      most = blood.shed_pl;
    });
    EXPECT_GT(most, 1'000'000'000) << "over a millilitre, or this has shown nothing";
    EXPECT_GT(bleeding.blood().sucked_pl, 0);
  }
}

TEST(Bleeding, EqualFramesGiveEqualBlood) {
  std::vector<std::uint32_t> crcs;
  for (int run = 0; run < 2; ++run) {
    Bleeding bleeding(Rules{});
    std::size_t next = 0;
    cut_liver(7, 1600, [&](step::PublishedFrame& frame, step::Simulation& simulation) {
      bleeding.observe(frame, simulation.layout(), simulation.state().tools);
      if (run == 0)
        crcs.push_back(frame.blood_crc);
      else
        ASSERT_EQ(frame.blood_crc, crcs.at(next++));
    });
  }
}

// A restore builds anew what follows from the layout, and it must come out to the bit.
TEST(Bleeding, ARestoredStateGoesOnAsIfNothingHadBeen) {
  Bleeding bleeding(Rules{});
  std::optional<Bleeding> restored;
  cut_liver(5, 2400, [&](step::PublishedFrame& frame, step::Simulation& simulation) {
    if (frame.frame % 25 == 0) {
      restored.emplace(Rules{});
      ASSERT_TRUE(restored->restore_state(state_of(bleeding)).ok());
    }
    step::PublishedFrame again = frame;
    bleeding.observe(frame, simulation.layout(), simulation.state().tools);
    if (!restored) return;
    again.change = nullptr;  // as after a start from a snapshot
    restored->observe(again, simulation.layout(), simulation.state().tools);
    ASSERT_EQ(again.blood, frame.blood) << "frame " << frame.frame;
    ASSERT_EQ(again.figures.blood, frame.figures.blood);
    ASSERT_EQ(state_of(*restored), state_of(bleeding)) << "frame " << frame.frame;
  });
}

TEST(Bleeding, BytesThatAreNoStateAreRefused) {
  Bleeding bleeding(Rules{});
  cut_liver(3, 800, [&](step::PublishedFrame& frame, step::Simulation& simulation) {
    bleeding.observe(frame, simulation.layout(), simulation.state().tools);
  });
  const Bytes whole = state_of(bleeding);
  for (std::size_t size = 0; size < whole.size(); size += 97) {
    Bleeding other(Rules{});
    EXPECT_FALSE(other.restore_state(BytesView(whole).first(size)).ok()) << size;
  }
  // A volume that is not in the sums.
  Bytes wrong = whole;
  wrong[4 + 3] ^= 0x40;
  Bleeding other(Rules{});
  EXPECT_FALSE(other.restore_state(wrong).ok());
  EXPECT_TRUE(other.restore_state(whole).ok());
}

// Two marks stand side by side; a return to the first is not one to the second.
TEST(Bleeding, AReturnToAMarkBringsItsBloodBack) {
  Bleeding bleeding(Rules{});
  std::optional<std::int64_t> first_pl, second_pl;
  cut_liver(2, 2400, [&](step::PublishedFrame& frame, step::Simulation& simulation) {
    const auto before = bleeding.blood().shed_pl;
    const auto add = [&](hands::MarkAction action, std::uint8_t number) {
      frame.mark_events.push_back({frame.tick, action, true, number});
    };
    if (frame.frame == 60) add(hands::MarkAction::Set, 0), first_pl = before;
    if (frame.frame == 90) add(hands::MarkAction::Set, 3), second_pl = before;
    if (frame.frame == 110) add(hands::MarkAction::Return, 0);
    if (frame.frame == 130) add(hands::MarkAction::Return, 3);
    bleeding.observe(frame, simulation.layout(), simulation.state().tools);
    const auto after = bleeding.blood().shed_pl;
    if (frame.frame == 110) {
      EXPECT_GE(after, *first_pl);
      EXPECT_LT(after, *second_pl);
    }
    if (frame.frame == 130) {
      EXPECT_GE(after, *second_pl);
    }
  });
  ASSERT_TRUE(first_pl && second_pl);
  EXPECT_GT(*second_pl, *first_pl);
}

}  // namespace
}  // namespace trocar::bleeding
