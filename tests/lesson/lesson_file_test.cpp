#include <gtest/gtest.h>

#include <fstream>

#include "common/lesson/lesson.h"
#include "common/lesson/lesson_texts.h"
#include "common/wire/lesson.h"
#include "tests/support/files.h"

namespace trocar::lesson {
namespace {

constexpr const char* kHead = "title = \"T\"\ntext = \"What to do.\"\n";
constexpr const char* kBall =
    "[[structure]]\nname = \"lump\"\ncentre_mm = [0, 0, 0]\nradius_mm = 9\n";
constexpr const char* kFind =
    "[[stage]]\nname = \"S\"\ntext = \"Find it.\"\ngoal = \"find\"\nstructure = \"lump\"\n";

std::string error_of(const std::string& text) {
  const auto lesson = read_lesson_text(text, "x.toml");
  return lesson ? "" : lesson.error().message;
}

TEST(LessonFile, AllThatShipAreGood) {
  EXPECT_EQ(lesson_texts().size(), 7u);
  for (const auto& [name, text] : lesson_texts()) {
    const auto lesson = read_lesson_text(text, name);
    ASSERT_TRUE(lesson) << lesson.error().message;
    for (const auto& stage : lesson->stages) EXPECT_FALSE(stage.scores.empty()) << name;
  }
}

TEST(LessonFile, ReadsLengthsInMillimetres) {
  const auto lesson = read_lesson_text(
      std::string(kHead) + kBall + kFind +
          "tolerance_mm = 4\n[[stage.score]]\nmeasure = \"error_mm\"\nfull = 1\nnone = 5\n",
      "x.toml");
  ASSERT_TRUE(lesson) << lesson.error().message;
  EXPECT_DOUBLE_EQ(lesson->structures[0].radius_m, 0.009);
  EXPECT_DOUBLE_EQ(lesson->stages[0].tolerance_m, 0.004);
  const auto& score = lesson->stages[0].scores[0];
  EXPECT_DOUBLE_EQ(score.points(0.0005), 1);
  EXPECT_DOUBLE_EQ(score.points(0.003), 0.5);
  EXPECT_DOUBLE_EQ(score.points(0.006), 0);
}

TEST(LessonFile, AStageHasAPictureBesideTheFile) {
  const trocar::testing::TemporaryFolder folder;
  const auto file = folder.file("own.toml");
  const auto write = [](const std::string& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
  };
  const auto error_with = [&](const std::string& picture) {
    write(file, std::string(kHead) + kBall + kFind + "picture = \"" + picture + "\"\n");
    const auto lesson = read_lesson(file);
    return lesson ? "" : lesson.error().message;
  };
  write(folder.file("a.png"), "\x89PNG\r\n\x1a\n and so on");
  EXPECT_EQ(error_with("a.png"), "");
  const auto lesson = read_lesson(file);
  ASSERT_TRUE(lesson);
  ASSERT_NE(lesson->find_picture("a.png"), nullptr);
  EXPECT_TRUE(lesson->find_picture("a.png")->bytes.ends_with("so on"));
  write(folder.file("a.txt"), "words");
  EXPECT_EQ(error_with("a.txt"), file + ": picture a.txt: is neither a PNG nor a JPEG file");
  EXPECT_NE(error_with("b.png").find("b.png"), std::string::npos);
  EXPECT_NE(error_with("../a.png").find("without a folder"), std::string::npos);
  write(folder.file("large.png"), std::string(wire::kMostPictureBytes + 1, 'x'));
  EXPECT_NE(error_with("large.png").find("allowed"), std::string::npos) << error_with("large.png");
}

TEST(LessonFile, ThoseThatShipHaveTheirPictures) {
  const auto rings = find_lesson("move-the-rings");
  ASSERT_TRUE(rings) << rings.error().message;
  EXPECT_EQ(rings->pictures.size(), 1u);
}

TEST(LessonFile, ReadsWhereAPieceIsCarried) {
  const std::string stage =
      std::string(kHead) + "[[stage]]\nname = \"S\"\ntext = \"Carry it.\"\ngoal = \"carry\"\n";
  const auto lesson = read_lesson_text(
      stage + "from_mm = [1, 2, 3]\nto_mm = [40, 0, 0]\nhands = 2\nhold_s = 1\n", "x.toml");
  ASSERT_TRUE(lesson) << lesson.error().message;
  EXPECT_EQ(lesson->stages[0].hands, 2);
  ASSERT_EQ(lesson->stages[0].line_m.size(), 2u);
  EXPECT_DOUBLE_EQ(lesson->stages[0].line_m[1].x, 0.04);
  EXPECT_NE(error_of(stage + "from_mm = [1, 2, 3]\n").find("to_mm: is missing, say where"),
            std::string::npos)
      << error_of(stage + "from_mm = [1, 2, 3]\n");
  EXPECT_NE(error_of(stage + "from_mm = [1, 2, 3]\nto_mm = [1, 2, 3]\n").find("to_mm"),
            std::string::npos);
}

TEST(LessonFile, ReadsWhatBleeds) {
  const auto dry = read_lesson_text(std::string(kHead) + kBall + kFind, "x.toml");
  ASSERT_TRUE(dry) << dry.error().message;
  EXPECT_FALSE(dry->bleeds);
  EXPECT_EQ(dry->structures[0].vessel_pressure_pa, 0);
  const auto lesson =
      read_lesson_text(std::string(kHead) + "bleeding = true\n" + kBall +
                           "vessel_pressure_mmhg = 75\nvessel_flow_ml_min = 120\n" + kFind +
                           "[[stage.score]]\nmeasure = \"blood_ml\"\nfull = 10\nnone = 30\n",
                       "x.toml");
  ASSERT_TRUE(lesson) << lesson.error().message;
  EXPECT_TRUE(lesson->bleeds);
  EXPECT_NEAR(lesson->structures[0].vessel_pressure_pa, 10'000, 1);
  EXPECT_NEAR(lesson->structures[0].vessel_flow_m3_s, 2e-6, 1e-12);
  EXPECT_NEAR(lesson->stages[0].scores[0].points(20e-6), 0.5, 1e-9);
  EXPECT_NE(error_of(std::string(kHead) + kBall + "vessel_flow_ml_min = 120\n" + kFind)
                .find("say vessel_pressure_mmhg as well"),
            std::string::npos);
  EXPECT_NE(error_of(std::string(kHead) + kBall + "vessel_pressure_mmhg = 900\n" + kFind)
                .find("vessel_pressure_mmhg: is 900"),
            std::string::npos);
}

TEST(LessonFile, SaysWhatIsWrongAndWhere) {
  const std::string head = kHead, whole = head + kBall + kFind;
  EXPECT_EQ(error_of(whole), "");
  EXPECT_EQ(error_of(head), "x.toml:1: key stage: is missing, add a [[stage]] with a goal");
  EXPECT_NE(error_of(head + kFind).find("no [[structure]] above has that name"), std::string::npos);
  EXPECT_NE(error_of(whole + "lap_s = 3\n").find("key stage[0].lap_s: is unknown"),
            std::string::npos);
  EXPECT_NE(error_of(whole + "limit_s = -1\n").find("x.toml:12: key stage[0].limit_s: is -1"),
            std::string::npos);
  EXPECT_NE(
      error_of(whole + "[[stage.score]]\nmeasure = \"beauty\"\n").find("is not one of time_s"),
      std::string::npos);
  EXPECT_NE(error_of(whole + "[[stage.score]]\nmeasure = \"time_s\"\nfull = 9\nnone = 3\n")
                .find("which has to be more than full"),
            std::string::npos);
  EXPECT_NE(
      error_of(whole + "[[stage]]\nname = \"L\"\ntext = \"t\"\ngoal = \"follow\"\nline_mm = 3\n")
          .find("is not a list of points"),
      std::string::npos);
  EXPECT_NE(error_of(head + kBall + kBall + kFind).find("is that of another one above"),
            std::string::npos);
}

TEST(LessonFile, TooManyStagesAreRefused) {
  std::string text = std::string(kHead) + kBall;
  for (std::size_t i = 0; i <= kMostStages; ++i) text += kFind;
  EXPECT_NE(error_of(text).find("is one too many, there may be 16"), std::string::npos);
}

}  // namespace
}  // namespace trocar::lesson
