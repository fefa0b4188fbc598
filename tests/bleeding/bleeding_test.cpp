// Laws of a session's blood on an organ that is being cut: nothing is lost, and equal ticks give
// equal blood, however they are reached.

#include "server/tissue/bleeding/bleeding.h"

#include <gtest/gtest.h>

#include <optional>

#include "server/organs/catalogue/builtin_organs.h"
#include "tests/bleeding/cut_liver.h"

namespace trocar::bleeding {
namespace {

using testing::cut_liver;

TEST(Bleeding, NothingIsLostWhateverIsCut) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    Blood blood;
    cut_liver(seed, 3000, [&](step::PublishedFrame& frame, step::Simulation& simulation) {
      const auto before_pl = blood.shed_pl;
      blood = *simulation.state().blood;
      ASSERT_EQ(blood.volume_pl.size(), simulation.layout().vertex_count());
      ASSERT_EQ(blood.shed_pl, blood.on_surface_pl() + blood.dripped_pl + blood.sucked_pl)
          << "seed " << seed << ", frame " << frame.frame;
      for (const auto pl : blood.volume_pl) ASSERT_GE(pl, 0);
      ASSERT_GE(blood.shed_pl, before_pl) << "blood does not run back";
      ASSERT_EQ(frame.blood, blood.levels);
      ASSERT_EQ(frame.blood_crc, wire::blood_crc(blood.levels));
    });
    EXPECT_GT(blood.shed_pl, 1'000'000'000) << "over a millilitre, or this has shown nothing";
    EXPECT_GT(blood.sucked_pl, 0);
  }
}

TEST(Bleeding, IsInTheHashOfTheNextTick) {
  std::optional<step::Simulation> dry;
  std::uint64_t ticks_apart = 0;
  cut_liver(
      7, 600,
      [&](step::PublishedFrame&, step::Simulation& simulation) {
        ticks_apart += dry->state_hash() != simulation.state_hash();
      },
      [&](Tick tick, const hands::TickInputs& inputs) {
        if (tick == 1) dry.emplace(*catalogue::make_liver(800));
        dry->tick(inputs, {});
      });
  EXPECT_EQ(ticks_apart, 600u / kTicksPerFrame) << "also before the first cut: its arrays stand";
}

// A restored state builds anew what follows from the layout, and it must come out to the bit.
TEST(Bleeding, ARestoredStateGoesOnAsIfNothingHadBeen) {
  std::optional<step::Simulation> restored;
  std::shared_ptr<step::PublishedFrame> again;
  std::uint64_t frames = 0;
  const auto observe = [&](step::PublishedFrame& frame, step::Simulation& simulation) {
    if (restored) {
      ASSERT_TRUE(again);
      ASSERT_EQ(again->blood, frame.blood) << "frame " << frame.frame;
      ASSERT_EQ(again->figures.blood, frame.figures.blood);
      ASSERT_EQ(restored->state_hash(), simulation.state_hash()) << "frame " << frame.frame;
      ++frames;
    }
    if (frame.frame % 25 != 0) return;
    Bytes state;
    simulation.write_snapshot(state);
    if (!restored) restored.emplace(simulation.beside());
    ASSERT_TRUE(restored->restore_snapshot(state).ok());
  };
  cut_liver(5, 2400, observe, [&](Tick, const hands::TickInputs& inputs) {
    if (!restored) return;
    restored->tick(inputs, {});
    if (auto frame = restored->pop_frame()) again = frame;
  });
  EXPECT_GT(frames, 100u);
}

TEST(Bleeding, BytesThatAreNoStateAreRefused) {
  Blood blood;
  cut_liver(3, 800, [&](step::PublishedFrame&, step::Simulation& simulation) {
    blood = *simulation.state().blood;
  });
  Bytes whole;
  auto writing = world::StateArchive::writing(whole);
  blood.visit_state(writing);
  const auto is_read = [](BytesView bytes) {
    Blood other;
    auto reading = world::StateArchive::reading(bytes);
    other.visit_state(reading);
    return reading.ok() && reading.at_end();
  };
  for (std::size_t size = 0; size < whole.size(); size += 97)
    EXPECT_FALSE(is_read(BytesView(whole).first(size))) << size;
  for (std::size_t at = 0; at < whole.size(); at += whole.size() / 50) {
    Bytes wrong = whole;
    wrong[at] ^= 0x40;
    EXPECT_FALSE(is_read(wrong)) << at;
  }
  EXPECT_TRUE(is_read(whole));
}

// Two marks stand side by side; a return to the first is not one to the second.
TEST(Bleeding, AReturnToAMarkBringsItsBloodBack) {
  constexpr Tick kFirst = 961, kSecond = 1441, kToFirst = 1761, kToSecond = 2081;
  std::int64_t shed_pl = 0, first_pl = 0, second_pl = 0;
  const auto observe = [&](step::PublishedFrame& frame, step::Simulation& simulation) {
    shed_pl = simulation.state().blood->shed_pl;
    if (frame.tick == kToFirst - 1 + kTicksPerFrame) {
      EXPECT_GE(shed_pl, first_pl);
      EXPECT_LT(shed_pl, second_pl);
    }
    if (frame.tick == kToSecond - 1 + kTicksPerFrame) {
      EXPECT_GE(shed_pl, second_pl);
    }
  };
  cut_liver(2, 2400, observe, [&](Tick tick, hands::TickInputs& inputs) {
    const auto use = [&](hands::MarkAction action, std::uint8_t number) {
      inputs.mark = action;
      inputs.mark_number = number;
    };
    if (tick == kFirst) use(hands::MarkAction::Set, 0), first_pl = shed_pl;
    if (tick == kSecond) use(hands::MarkAction::Set, 3), second_pl = shed_pl;
    if (tick == kToFirst) use(hands::MarkAction::Return, 0);
    if (tick == kToSecond) use(hands::MarkAction::Return, 3);
  });
  EXPECT_GT(first_pl, 0);
  EXPECT_GT(second_pl, first_pl);
}

}  // namespace
}  // namespace trocar::bleeding
