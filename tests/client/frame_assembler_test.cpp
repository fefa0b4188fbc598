// Slices and parts in any order, twice, too late, or of somebody who means harm.

#include "client/replica/frame_assembler.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "proto/wire.pb.h"

namespace trocar::replica {
namespace {

wire::QuantisedSurface make_surface(std::size_t vertices, std::uint32_t seed) {
  std::mt19937 random(seed);
  wire::QuantisedSurface surface(vertices);
  const auto value = [&random] { return static_cast<std::int32_t>(random() % 4001) - 2000; };
  for (auto& vertex : surface) vertex = {value(), value(), value()};
  return surface;
}

std::vector<proto::SurfaceSlice> slices_of(Frame frame, Frame base,
                                           const wire::QuantisedSurface& from,
                                           const wire::QuantisedSurface& to) {
  std::vector<proto::SurfaceSlice> messages;
  const auto slices = wire::encode_slices(from, to, 600);
  for (std::size_t i = 0; i < slices.size(); ++i) {
    proto::SurfaceSlice message;
    message.set_frame(frame);
    message.set_base_frame(base);
    message.set_slice(static_cast<std::uint32_t>(i));
    message.set_slices(static_cast<std::uint32_t>(slices.size()));
    message.set_first_vertex(slices[i].first_vertex);
    message.set_vertices(slices[i].vertices);
    message.set_payload(slices[i].payload.data(), slices[i].payload.size());
    messages.push_back(message);
  }
  return messages;
}

class FrameAssemblerTest : public ::testing::Test {
 protected:
  static constexpr std::size_t kVertices = 700;
  FrameAssemblerTest() { assembler_.keep(10, before_); }

  const wire::QuantisedSurface before_ = make_surface(kVertices, 1);
  const wire::QuantisedSurface after_ = make_surface(kVertices, 2);
  FrameAssembler assembler_;
};

TEST_F(FrameAssemblerTest, AFrameIsWholeWithItsLastSlice) {
  auto slices = slices_of(12, 10, before_, after_);
  ASSERT_GT(slices.size(), 3u);
  std::ranges::shuffle(slices, std::mt19937(5));
  for (std::size_t i = 0; i + 1 < slices.size(); ++i) {
    EXPECT_FALSE(assembler_.add(slices[i], kVertices));
    EXPECT_FALSE(assembler_.add(slices[i], kVertices)) << "twice";
  }
  const auto whole = assembler_.add(slices.back(), kVertices);
  ASSERT_TRUE(whole);
  EXPECT_EQ(whole->header.frame, 12u);
  EXPECT_EQ(whole->surface, after_);
}

TEST_F(FrameAssemblerTest, ItsBaseMustBeKnownAndMayBeSmaller) {
  for (const auto& slice : slices_of(12, 11, before_, after_))
    EXPECT_FALSE(assembler_.add(slice, kVertices));
  auto longer = before_, grown = make_surface(kVertices + 50, 3);
  longer.resize(grown.size());
  std::optional<FrameAssembler::Whole> whole;
  for (const auto& slice : slices_of(13, 10, longer, grown))
    whole = assembler_.add(slice, grown.size());
  ASSERT_TRUE(whole);
  EXPECT_EQ(whole->surface, grown);
  for (Frame frame = 11; frame <= 10 + FrameAssembler::kKept; ++frame)
    assembler_.keep(frame, before_);
  EXPECT_EQ(assembler_.find(10), nullptr) << "too old";
  assembler_.clear();
  EXPECT_EQ(assembler_.find(11), nullptr);
}

TEST_F(FrameAssemblerTest, SlicesThatContradictEachOtherAreDropped) {
  auto slices = slices_of(12, 10, before_, after_);
  auto wrong = slices[1];
  EXPECT_FALSE(assembler_.add(slices[0], kVertices));
  wrong.set_slices(wrong.slices() + 1);
  EXPECT_FALSE(assembler_.add(wrong, kVertices));
  wrong = slices[1];
  wrong.set_slice(64);
  EXPECT_FALSE(assembler_.add(wrong, kVertices));
  wrong = slices[1];
  wrong.set_slices(0);
  EXPECT_FALSE(assembler_.add(wrong, kVertices));
  wrong = slices[1];
  wrong.set_first_vertex(kVertices + 64);
  EXPECT_FALSE(assembler_.add(wrong, kVertices));
  wrong = slices[1];
  wrong.set_payload("no such thing");
  EXPECT_FALSE(assembler_.add(wrong, kVertices));
  std::optional<FrameAssembler::Whole> whole;
  for (std::size_t i = 1; i < slices.size(); ++i) whole = assembler_.add(slices[i], kVertices);
  ASSERT_TRUE(whole) << "the right ones still make a frame";
  EXPECT_EQ(whole->surface, after_);
}

TEST_F(FrameAssemblerTest, AStateInPartsIsReadOnceAllAreThere) {
  proto::FrameState state;
  state.set_frame(12);
  for (int i = 0; i < 400; ++i) state.add_region_runs(static_cast<std::uint32_t>(i));
  const auto bytes = state.SerializeAsString();
  const auto half = bytes.size() / 2;
  const auto part = [&](std::uint32_t number) {
    proto::FrameStatePart message;
    message.set_frame(12);
    message.set_part(number);
    message.set_parts(2);
    message.set_state(number == 0 ? bytes.substr(0, half) : bytes.substr(half));
    return message;
  };
  EXPECT_FALSE(assembler_.add(part(1)));
  EXPECT_FALSE(assembler_.add(part(1)));
  const auto whole = assembler_.add(part(0));
  ASSERT_TRUE(whole);
  EXPECT_EQ(whole->region_runs_size(), 400);
  auto wrong = part(0);
  wrong.set_parts(17);
  EXPECT_FALSE(assembler_.add(wrong));
  wrong.set_parts(1);
  wrong.set_state("\xff\xff");
  EXPECT_FALSE(assembler_.add(wrong));
}

}  // namespace
}  // namespace trocar::replica
