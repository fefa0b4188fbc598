#include "common/lesson/course.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/lesson/boxes.h"

namespace trocar::lesson {
namespace {

constexpr ToolSlot kTool{0}, kOther{2};

// Plays frames of one or two tools on a box of 0.1 m, whose upper face is at y = 0.05.
class Play {
 public:
  explicit Play(Stage stage, std::vector<Structure> structures = {})
      : course(make(stage, structures)) {
    add_box(layout, {-0.05, -0.05, -0.05}, {0.05, 0.05, 0.05}, false, true);
    displacements.resize(layout.vertex_count());
  }
  static Lesson make(const Stage& stage, const std::vector<Structure>& structures) {
    Lesson lesson;
    lesson.title = "T";
    lesson.structures = structures;
    lesson.stages = {stage};
    return lesson;
  }
  Moment moment() const {
    return {.tick = tick, .tips = tips, .displacements = displacements, .layout = &layout};
  }
  void frame() {
    tick += kTicksPerFrame;
    course.observe(moment());
  }
  void seconds(double s) {
    for (int i = 0; i < static_cast<int>(s / 0.016); ++i) frame();
  }

  wire::SurfaceLayout layout;
  wire::QuantisedSurface displacements;
  std::vector<Tip> tips{{.tool = kTool, .position_m = {0, 0.1, 0}}};
  Tick tick = 1600;
  Course course;
};

TEST(Course, FindTakesThePlaceAtRestUnderTheTip) {
  Stage stage{.name = "S", .text = "t", .goal = Goal::Find, .structure = "lump"};
  stage.tolerance_m = 0.005;
  // Vertices are the box's corners: the structure lies at one of them.
  Play play(stage, {{.name = "lump", .from_m = {0.05, 0.05, 0.05}, .to_m = {0.05, 0.05, 0.05}}});
  play.frame();
  EXPECT_EQ(play.course.answer(kTool, play.moment()), Answer::NoTissue);
  play.tips[0].position_m = {-0.05, 0.05, 0.05};
  EXPECT_EQ(play.course.answer(kTool, play.moment()), Answer::Wrong);
  // The corner has moved by 20 mm, and the tip is where it is now.
  play.displacements[7] = quanta_of({0, -0.02, 0});
  play.tips[0].position_m = {0.05, 0.03, 0.05};
  EXPECT_EQ(play.course.answer(kOther, play.moment()), Answer::NoTissue);
  EXPECT_EQ(play.course.answer(kTool, play.moment()), Answer::Right);
  ASSERT_TRUE(play.course.is_over());
  EXPECT_TRUE(play.course.results()[0].is_reached);
  EXPECT_EQ(play.course.results()[0].value(Measure::WrongAnswers), 1);
  EXPECT_EQ(play.course.answer(kTool, play.moment()), Answer::NotAsked);
}

TEST(Course, BloodIsCountedFromTheBeginningOfTheStage) {
  Stage stage{.name = "S", .text = "t", .goal = Goal::Find, .structure = "lump"};
  stage.limit_s = 2;
  Play play(stage, {{.name = "lump"}});
  auto moment = play.moment();
  for (const double ml : {5.0, 6.0, 17.0}) {
    moment.tick += kTicksPerFrame;
    moment.blood_m3 = ml * 1e-6;
    play.course.observe(moment);
  }
  moment.tick += 3000;
  play.course.observe(moment);
  ASSERT_TRUE(play.course.is_over());
  EXPECT_NEAR(play.course.results()[0].value(Measure::Blood), 12e-6, 1e-12);
  Play dry(stage, {{.name = "lump"}});
  dry.seconds(3);
  ASSERT_TRUE(dry.course.is_over());
  EXPECT_TRUE(std::isnan(dry.course.results()[0].value(Measure::Blood))) << "nothing bleeds";
}

TEST(Course, FollowMeasuresTheDistanceFromThePoint) {
  Stage stage{.name = "F", .text = "t", .goal = Goal::Follow};
  stage.line_m = {{0, 0.1, 0}, {0.04, 0.1, 0}};
  stage.lap_s = 4, stage.hold_s = 2, stage.tolerance_m = 0.006, stage.limit_s = 10;
  Play play(stage);
  play.frame();
  while (!play.course.is_over()) {
    // 3 mm above the point where it will be in the next frame: within 0.4 mm of it.
    play.tips[0].position_m = *play.course.target_m() + Vec3d{0, 0.003, 0};
    play.frame();
  }
  const auto& result = play.course.results()[0];
  EXPECT_TRUE(result.is_reached);
  EXPECT_NEAR(result.value(Measure::Time), 2, 0.05);
  EXPECT_NEAR(result.value(Measure::Error), 0.003, 1e-4);
  // The point goes at 20 mm/s for two seconds.
  EXPECT_NEAR(result.value(Measure::Path), 0.04, 0.004);
}

TEST(Course, ThePointGoesThereAndBack) {
  Stage stage{.name = "F", .text = "t", .goal = Goal::Follow};
  stage.line_m = {{0, 0, 0}, {0.04, 0, 0}};
  stage.lap_s = 4, stage.limit_s = 100;
  Play play(stage);
  play.frame();
  const auto at = [&](double s) {
    while (play.course.seconds() < s - 1e-9) play.frame();
    return play.course.target_m()->x;
  };
  EXPECT_NEAR(at(1), 0.02, 4e-4);
  EXPECT_NEAR(at(2), 0.04, 4e-4);
  EXPECT_NEAR(at(3), 0.02, 4e-4);
  EXPECT_NEAR(at(4), 0, 4e-4);
}

TEST(Course, LiftNeedsAGraspAndTheWay) {
  Stage stage{.name = "L", .text = "t", .goal = Goal::Lift};
  stage.lift_m = 0.02, stage.hold_s = 1, stage.force_limit_n = 2;
  Play play(stage);
  play.tips[0] = {.tool = kTool,
                  .position_m = {0, 0.05, 0},
                  .force_n = 1,
                  .verb = tool::Verb::Grasp,
                  .has_claim = true};
  play.seconds(0.5);
  play.tips[0].position_m.y = 0.065;
  play.seconds(2);
  EXPECT_FALSE(play.course.is_over());  // 15 mm are too little
  play.tips[0].position_m.y = 0.072;
  play.tips[0].force_n = 3;
  play.seconds(0.5);
  play.tips[0].has_claim = false;  // it slips
  play.seconds(0.5);
  EXPECT_FALSE(play.course.is_over());
  play.tips[0].has_claim = true;
  play.tips[0].force_n = 1;
  play.seconds(0.1);
  play.tips[0].position_m.y = 0.093;
  play.seconds(1.2);
  ASSERT_TRUE(play.course.is_over());
  const auto& result = play.course.results()[0];
  EXPECT_TRUE(result.is_reached);
  EXPECT_EQ(result.value(Measure::PeakForce), 3);
  EXPECT_NEAR(result.value(Measure::TimeAbove), 1.0, 0.05);
}

TEST(Course, HoldCountsHandsAtTheSameTime) {
  Stage stage{.name = "H", .text = "t", .goal = Goal::Hold, .hands = 2};
  stage.hold_s = 1;
  Play play(stage);
  const Tip one{.tool = kTool, .verb = tool::Verb::Grasp, .has_claim = true};
  Tip two = one;
  two.tool = kOther;
  play.tips = {one};
  play.seconds(2);
  EXPECT_FALSE(play.course.is_over());
  play.tips = {one, two};
  play.seconds(1.1);
  EXPECT_TRUE(play.course.is_over());
}

TEST(Course, InciseAndRemoveFollowTheSurface) {
  Stage stage{.name = "I", .text = "t", .goal = Goal::Incise};
  stage.line_m = {{0, 0.05, 0}, {0.02, 0.05, 0}};
  stage.depth_m = 0.005, stage.tolerance_m = 0.004;
  Play play(stage);
  play.seconds(1);
  for (double x = 0; x < 0.02; x += 0.004)
    add_wound(play.layout, {x, 0.05, 0}, {x + 0.004, 0.05, 0}, {x, 0.044, 0});
  ++play.layout.epoch;
  play.displacements.resize(play.layout.vertex_count());
  play.seconds(0.5);
  ASSERT_TRUE(play.course.is_over());
  EXPECT_TRUE(play.course.results()[0].is_reached);

  Stage remove{.name = "R", .text = "t", .goal = Goal::Remove, .structure = "lump"};
  remove.margin_m = 0.005;
  Play other(remove,
             {{.name = "lump", .from_m = {0, 0, 0.1}, .to_m = {0, 0, 0.1}, .radius_m = 0.004}});
  other.seconds(1);
  EXPECT_FALSE(other.course.is_over());
  add_box(other.layout, {-0.01, -0.01, 0.09}, {0.01, 0.01, 0.11}, true, false);
  ++other.layout.epoch;
  other.displacements.resize(other.layout.vertex_count());
  other.seconds(0.5);
  ASSERT_TRUE(other.course.is_over());
  EXPECT_NEAR(other.course.results()[0].value(Measure::Volume), 8e-6, 1e-7);
  EXPECT_EQ(other.course.results()[0].value(Measure::MissingMargin), 0);
}

// A loose cube of 20 mm stands beside the box, and is to be 0.1 m farther right.
TEST(Course, APieceIsCarriedFromHandToHandToItsPlaceAndLetGo) {
  Stage stage{.name = "C", .text = "t", .goal = Goal::Carry};
  stage.line_m = {{0.1, 0, 0}, {0.2, 0, 0}};
  stage.tolerance_m = 0.004, stage.hold_s = 1, stage.hands = 2;
  Play play(stage);
  add_box(play.layout, {0.09, -0.01, -0.01}, {0.11, 0.01, 0.01}, false, false);
  play.displacements.resize(play.layout.vertex_count());
  const auto move_piece = [&](double x) {
    for (std::size_t v = 8; v < 16; ++v) play.displacements[v] = quanta_of({x, 0, 0});
  };
  const auto grasp = [](ToolSlot tool, double x) {
    return Tip{
        .tool = tool, .position_m = {x, 0.01, 0.01}, .verb = tool::Verb::Grasp, .has_claim = true};
  };
  // Lying at its place does not count before two hands have held it.
  move_piece(0.1);
  play.seconds(3);
  EXPECT_FALSE(play.course.is_over());
  EXPECT_NEAR(length(*play.course.target_m() - Vec3d{0.2, 0, 0}), 0, 1e-12);
  move_piece(0);
  play.tips = {grasp(kTool, 0.09)};
  play.seconds(0.5);
  move_piece(0.05);
  play.tips = {grasp(kTool, 0.14), grasp(kOther, 0.16)};
  play.seconds(0.5);
  play.tips = {grasp(kOther, 0.16)};
  play.seconds(0.5);
  play.tips = {{.tool = kOther, .position_m = {0.16, 0.01, 0.01}}};
  play.seconds(0.5);  // it is let go on the way
  play.tips = {grasp(kOther, 0.16)};
  play.frame();
  move_piece(0.098);
  play.tips = {grasp(kOther, 0.21)};
  play.seconds(2);
  EXPECT_FALSE(play.course.is_over()) << "it is still held";
  play.tips = {{.tool = kOther, .position_m = {0.21, 0.03, 0.01}}};
  play.seconds(0.9);
  EXPECT_FALSE(play.course.is_over());
  play.seconds(0.2);
  ASSERT_TRUE(play.course.is_over());
  const auto& result = play.course.results()[0];
  EXPECT_TRUE(result.is_reached);
  EXPECT_EQ(result.value(Measure::Drops), 1);
  EXPECT_NEAR(result.value(Measure::Error), 0.002, 48e-6) << "to quanta of the wire";
}

TEST(Course, WhatIsHeldIsNotALoosePiece) {
  Stage stage{.name = "C", .text = "t", .goal = Goal::Carry};
  stage.line_m = {{0, 0, 0}, {0, 0, 0.001}};
  stage.hold_s = 0.1;
  Play play(stage);
  play.seconds(1);
  EXPECT_FALSE(play.course.is_over()) << "the box is fixed";
}

TEST(Course, PointsAreTheMeanOfWhatIsScored) {
  Stage stage{.name = "L", .text = "t", .goal = Goal::Lift};
  stage.lift_m = 0.01, stage.hold_s = 0.5;
  stage.scores = {{.measure = Measure::PeakForce, .full = 1, .none = 3},
                  {.measure = Measure::Refusals, .full = 0, .none = 4}};
  Play play(stage);
  play.tips[0] = {.tool = kTool,
                  .position_m = {0, 0.05, 0},
                  .force_n = 2,
                  .verb = tool::Verb::Grasp,
                  .has_claim = true};
  play.frame();
  play.course.note_refusal();
  play.tips[0].position_m.y = 0.07;
  play.seconds(1);
  ASSERT_TRUE(play.course.is_over());
  EXPECT_NEAR(play.course.results()[0].points, 100 * (0.5 + 0.75) / 2, 1e-9);
}

TEST(Course, TimeRunsOutAndTheInstructorGoesOnAndBack) {
  Stage stage{.name = "H", .text = "t", .goal = Goal::Hold};
  stage.limit_s = 1, stage.hint = "h", stage.hint_after_s = 0.5;
  Lesson lesson = Play::make(stage, {});
  lesson.stages.push_back(stage);
  Play play(stage);
  play.course = Course(lesson);
  play.seconds(0.4);
  EXPECT_FALSE(play.course.shows_hint());
  play.seconds(0.3);
  EXPECT_TRUE(play.course.shows_hint());
  play.seconds(0.5);
  EXPECT_EQ(play.course.stage_number(), 1u);
  EXPECT_EQ(play.course.results()[0].points, 0);
  play.course.skip();
  EXPECT_TRUE(play.course.is_over());
  play.course.restart();
  EXPECT_FALSE(play.course.is_over());
  EXPECT_EQ(play.course.stage_number(), 0u);
  EXPECT_NEAR(play.course.seconds(), 0, 1e-9);
}

}  // namespace
}  // namespace trocar::lesson
