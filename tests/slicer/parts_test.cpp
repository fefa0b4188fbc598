// Frames, names, and instruments in the hands of peers.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "client/slicer/frames.h"
#include "client/slicer/publisher.h"
#include "client/slicer/tracked_tools.h"
#include "common/tool/instrument.h"
#include "proto/wire.pb.h"

namespace trocar::slicer {
namespace {

TEST(SlicerFrames, LeftHeadAndFrontAreMinusRSuperiorAndAnterior) {
  const Frames frames({0.01, 0.02, 0.03});
  EXPECT_EQ(frames.to_ras_mm({1, 0, 0}), (Vec3f{-1010, 30, 20}));
  EXPECT_EQ(frames.to_ras_mm({0, 1, 0}), (Vec3f{-10, 30, 1020}));
  EXPECT_EQ(frames.to_ras_mm({0, 0, 1}), (Vec3f{-10, 1030, 20}));
  const auto matrix = Frames().to_ras({});
  EXPECT_EQ(matrix, (Transform{{{-1, 0, 0, 0}, {0, 0, 1, 0}, {0, 1, 0, 0}}}));
}

TEST(SlicerFrames, APoseComesBackWhateverItIs) {
  const Frames frames({0.01, -0.02, 0.03});
  for (const auto& q : {Quatf{0, 0, 0, 1}, Quatf{1, 0, 0, 0}, Quatf{0, 1, 0, 0}, Quatf{0, 0, 1, 0},
                        Quatf{0.5f, -0.5f, 0.5f, 0.5f}, Quatf{0.1f, 0.7f, -0.2f, 0.4f},
                        Quatf{-0.9f, 0.1f, 0.1f, 0.1f}}) {
    const Pose pose{{0.1f, -0.2f, 0.3f}, normalized(q)};
    const auto back = frames.from_ras(frames.to_ras(pose));
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_LT(length(back->position - pose.position), 1e-6f);
    for (const Vec3f axis : {Vec3f{1, 0, 0}, Vec3f{0, 1, 0}, Vec3f{0, 0, 1}})
      EXPECT_LT(length(rotate(back->orientation, axis) - rotate(pose.orientation, axis)), 1e-5f);
  }
}

TEST(SlicerFrames, WhatIsNoPlaceForAToolIsRefused) {
  const auto refusal = [](Transform m) {
    const auto pose = Frames().from_ras(m);
    return pose ? std::string() : pose.error().message;
  };
  const Transform whole{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
  EXPECT_EQ(refusal(whole), "");
  EXPECT_NE(refusal({}).find("cannot be inverted"), std::string::npos);
  Transform m = whole;
  m[0][0] = -1;  // a mirror
  EXPECT_NE(refusal(m).find("no rotation"), std::string::npos);
  m = whole;
  m[1][1] = 1.02f;
  EXPECT_NE(refusal(m).find("no rotation within 0.01"), std::string::npos);
  m = whole;
  m[0][1] = 0.02f;
  EXPECT_NE(refusal(m).find("shears"), std::string::npos);
  m = whole;
  m[0][0] = 3e38f;
  EXPECT_NE(refusal(m).find("no rotation"), std::string::npos);
  m = whole;
  m[2][3] = 1999;
  EXPECT_EQ(refusal(m), "");
  m[2][3] = 2001;
  EXPECT_NE(refusal(m).find("2001 mm from the organ's centre, allowed are 2000"),
            std::string::npos);
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()})
    for (std::size_t row = 0; row < 3; ++row)
      for (std::size_t column = 0; column < 4; ++column) {
        m = whole;
        m[row][column] = bad;
        EXPECT_NE(refusal(m).find("not finite"), std::string::npos);
      }
}

TEST(SlicerNames, AreOfTheParticipantAndTheHandAndNeverTheSame) {
  EXPECT_EQ(tool_name("Ada", {0}), "Ada_R");
  EXPECT_EQ(tool_name("Ada", {1}), "Ada_L");
  EXPECT_EQ(tool_name("Dr. Ada", {2}), "Dr._Ada~1_R");
  EXPECT_EQ(tool_name("\u674e", {4}), "___~2_R");
  EXPECT_EQ(tool_name("a-very-long-name-1", {30}), "a-very-lo~15_R");
  EXPECT_LE((tool_name(std::string(60, 'x'), {31}) + "_force").size(), kMostNameBytes);
}

// Takes what leaves.
class Wire final : public replica::SessionSource {
 public:
  void poll(replica::MessageSink&) override {}
  bool send(const proto::Envelope& message) override {
    samples.push_back(message.tool_sample());
    return true;
  }
  void close(const std::string&) override {}
  replica::SourceState state() const override { return replica::SourceState::Live; }
  replica::CloseReason close_reason() const override { return {}; }
  replica::SourceStatistics statistics() const override { return {}; }
  std::string name() const override { return "wire"; }

  std::vector<proto::ToolSample> samples;
};

class SlicerTools : public ::testing::Test {
 protected:
  std::size_t sent_at(std::uint64_t ms) {
    wire_.samples.clear();
    tools_.send_due(wire_, 1'000'000'000 + ms * 1'000'000);
    return wire_.samples.size();
  }
  int verb() const { return static_cast<int>(wire_.samples.back().verb()); }

  static constexpr Transform kHere{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
  const std::vector<TrackedTool> given_{{"Left", tool::find_instrument("probe")->shape},
                                        {"Right", tool::find_instrument("grasper")->shape}};
  TrackedTools tools_{given_};
  Wire wire_;
};

TEST_F(SlicerTools, SamplesLeaveAtTheirOwnPaceHoweverOftenAPeerMoves) {
  EXPECT_EQ(sent_at(0), 0u) << "nobody has moved it";
  std::size_t sent = 0;
  for (std::uint64_t ms = 0; ms <= 100; ++ms) {
    for (int i = 0; i < 10; ++i) ASSERT_TRUE(tools_.move("Left", 1, kHere, {}));
    sent += sent_at(ms);
  }
  EXPECT_EQ(sent, 26u);
  EXPECT_EQ(verb(), static_cast<int>(tool::Verb::Push)) << "a probe pushes";
  EXPECT_EQ(sent_at(139), 0u) << "nothing new";
  EXPECT_EQ(sent_at(140), 1u) << "it is still there";
}

TEST_F(SlicerTools, OnePeerHoldsAnInstrumentUntilItGoes) {
  ASSERT_TRUE(tools_.move("Right", 1, kHere, {}));
  ASSERT_EQ(sent_at(0), 1u);
  EXPECT_EQ(wire_.samples.back().tool(), 1u);
  EXPECT_EQ(verb(), static_cast<int>(tool::Verb::None)) << "jaws wait for a word";
  ASSERT_TRUE(tools_.use("Right", 1, "grasp"));
  ASSERT_EQ(sent_at(10), 1u);
  EXPECT_EQ(verb(), static_cast<int>(tool::Verb::Grasp));
  EXPECT_FALSE(tools_.move("Right", 2, kHere, {}));
  EXPECT_FALSE(tools_.use("Right", 2, "none"));
  EXPECT_FALSE(tools_.use("Right", 1, "squeeze"));
  EXPECT_FALSE(tools_.use("Left", 1, "cut")) << "a probe has no edge";
  EXPECT_FALSE(tools_.move("Nobody", 1, kHere, {}));
  tools_.let_go(1);
  ASSERT_EQ(sent_at(20), 1u);
  EXPECT_EQ(verb(), static_cast<int>(tool::Verb::None)) << "it lets go";
  EXPECT_EQ(sent_at(2000), 0u) << "and is silent";
  EXPECT_TRUE(tools_.move("Right", 2, kHere, {}));
  EXPECT_EQ(sent_at(2010), 1u);
}

}  // namespace
}  // namespace trocar::slicer
