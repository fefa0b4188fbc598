// The TOML form: what is accepted, and one line that names file, line and key for what is not.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <ostream>
#include <random>

#include "common/tool/script.h"

namespace trocar::tool {
namespace {

const char* const kMinimal = R"([[tool]]
[[tool.key]]
time_s = 0
position_mm = [1, 2, 3]
)";

TEST(ScriptParse, AMinimalScriptHasDefaults) {
  const auto script = parse_script_text(kMinimal, "a.toml");
  ASSERT_TRUE(script.ok()) << script.error().message;
  ASSERT_EQ(script->tools.size(), 1u);
  const auto& tool = script->tools[0];
  EXPECT_EQ(tool.shape, ToolShape{});
  EXPECT_FALSE(tool.loops);
  EXPECT_FALSE(tool.anchor.has_value());
  ASSERT_EQ(tool.keys.size(), 1u);
  EXPECT_EQ(tool.keys[0].position_m, (Vec3f{0.001f, 0.002f, 0.003f}));
  EXPECT_EQ(tool.keys[0].verb, Verb::None);
  EXPECT_EQ(tool.keys[0].shaft, (Vec3f{0, 0, 1}));
}

TEST(ScriptParse, EveryKeyIsRead) {
  const auto script = parse_script_text(R"([[tool]]
radius_mm = 2.5
length_mm = 200
reach_mm = 12
loop = true
ease = "linear"
anchor = [0, -2, 0]
anchor_on = "extreme"
anchor_frame = "normal"
[[tool.key]]
time_s = 1
position_mm = [0, 0, 10.5]
shaft = [0, 3, 4]
verb = "grasp"
[[tool.key]]
time_s = 2.25
position_mm = [0, 0, 20]
[[tool.key]]
time_s = 3
position_mm = [0, 0, 10.5]
verb = "push"
[[tool]]
[[tool.key]]
time_s = 0
position_mm = [0, 0, 0]
)",
                                        "a.toml");
  ASSERT_TRUE(script.ok()) << script.error().message;
  ASSERT_EQ(script->tools.size(), 2u);
  const auto& tool = script->tools[0];
  EXPECT_FLOAT_EQ(tool.shape.radius_m, 0.0025f);
  EXPECT_FLOAT_EQ(tool.shape.length_m, 0.2f);
  EXPECT_FLOAT_EQ(tool.shape.reach_m, 0.012f);
  EXPECT_TRUE(tool.loops);
  EXPECT_EQ(tool.ease, Ease::Linear);
  ASSERT_TRUE(tool.anchor.has_value());
  EXPECT_EQ(*tool.anchor, (ScriptAnchor{{0, -1, 0}, AnchorOn::Extreme, AnchorFrame::Normal}));
  ASSERT_EQ(tool.keys.size(), 3u);
  EXPECT_EQ(tool.keys[0].verb, Verb::Grasp);
  EXPECT_EQ(tool.keys[1].verb, Verb::Grasp) << "a verb holds until the next one";
  EXPECT_EQ(tool.keys[2].verb, Verb::Push);
  EXPECT_FLOAT_EQ(tool.keys[1].shaft.y, 0.6f) << "a shaft holds until the next one";
  EXPECT_DOUBLE_EQ(tool.keys[1].time_s, 2.25);
}

struct Refused {
  const char* name;
  const char* text;
  const char* line_and_key;  // how the message goes on after the file name
  const char* says;          // what it must contain
};
void PrintTo(const Refused& refused, std::ostream* out) {
  *out << refused.name;
}

class ScriptRefused : public ::testing::TestWithParam<Refused> {};

TEST_P(ScriptRefused, WithLineKeyAndAdvice) {
  const auto& refused = GetParam();
  const auto script = parse_script_text(refused.text, "a.toml");
  ASSERT_FALSE(script.ok());
  const std::string& message = script.error().message;
  EXPECT_EQ(message.rfind(std::string("a.toml") + refused.line_and_key, 0), 0u) << message;
  EXPECT_NE(message.find(refused.says), std::string::npos) << message;
  EXPECT_EQ(message.find('\n'), std::string::npos) << "one line";
  EXPECT_EQ(script.error().code, ErrorCode::BadFile);
}

#define TOOL "[[tool]]\n"
#define KEY0 "[[tool.key]]\ntime_s = 0\nposition_mm = [0, 0, 0]\n"
INSTANTIATE_TEST_SUITE_P(
    Each, ScriptRefused,
    ::testing::Values(
        Refused{"Empty", "", ":1: key tool", "is missing"},
        Refused{"NotToml", "[[tool\n", ":1", "is not TOML"},
        Refused{"BadHeader", "[&", ": is not TOML", "header"},
        Refused{"LetterOutsideQuotes", "\u00e9 = 1", ":1: is not TOML", "\u00e9"},
        Refused{"ThreeBrackets", "[[[tool]]]", ": is not TOML", "header"},
        Refused{"NotUtf8", "a = \"\xff\"", ":1", "is not TOML"},
        Refused{"UnknownTop", TOOL KEY0 "[tols]\n", ":5: key tols", "is unknown"},
        Refused{"UnknownInTool", TOOL "radius = 3\n" KEY0,
                ":2: key tool[0].radius: ", "write radius_mm"},
        Refused{"UnknownInKey", TOOL KEY0 "verbs = \"push\"\n", ":5: key tool[0].key[0].verbs",
                "is unknown"},
        Refused{"ScenarioTable", "[organ]\nname = \"liver\"\n" TOOL KEY0, ":1: key organ",
                "only in a scenario"},
        Refused{"ToolNotTables", "tool = 3\n", ":1: key tool", "[[tool]]"},
        Refused{"NoKeys", TOOL, ":1: key tool[0].key", "is missing"},
        Refused{"KeyNotTables", TOOL "key = [1]\n", ":2: key tool[0].key", "[[tool.key]]"},
        Refused{"ThreeTools", TOOL KEY0 TOOL KEY0 TOOL KEY0, ":1: key tool", "at most 2"},
        Refused{"TimeMissing", TOOL "[[tool.key]]\nposition_mm = [0, 0, 0]\n",
                ":2: key tool[0].key[0].time_s", "is missing"},
        Refused{"TimeText", TOOL "[[tool.key]]\ntime_s = \"0\"\nposition_mm = [0, 0, 0]\n",
                ":3: key tool[0].key[0].time_s", "is not a number"},
        Refused{"TimeNegative", TOOL "[[tool.key]]\ntime_s = -0.1\nposition_mm = [0, 0, 0]\n",
                ":3: key tool[0].key[0].time_s", "allowed are 0 to"},
        Refused{"TimeNan", TOOL "[[tool.key]]\ntime_s = nan\nposition_mm = [0, 0, 0]\n",
                ":3: key tool[0].key[0].time_s", "not finite"},
        Refused{"TimeNotIncreasing", TOOL KEY0 KEY0, ":6: key tool[0].key[1].time_s",
                "order of time"},
        Refused{"PositionMissing", TOOL "[[tool.key]]\ntime_s = 0\n",
                ":2: key tool[0].key[0].position_mm", "is missing"},
        Refused{"PositionShort", TOOL "[[tool.key]]\ntime_s = 0\nposition_mm = [1, 2]\n",
                ":4: key tool[0].key[0].position_mm", "three numbers"},
        Refused{"PositionText", TOOL "[[tool.key]]\ntime_s = 0\nposition_mm = [1, 2, \"3\"]\n",
                ":4: key tool[0].key[0].position_mm", "three numbers"},
        Refused{"PositionInf", TOOL "[[tool.key]]\ntime_s = 0\nposition_mm = [1, 2, inf]\n",
                ":4: key tool[0].key[0].position_mm", "not finite"},
        Refused{"PositionFar", TOOL "[[tool.key]]\ntime_s = 0\nposition_mm = [0, 2000.1, 0]\n",
                ":4: key tool[0].key[0].position_mm", "2000 mm"},
        Refused{"ShaftZero", TOOL KEY0 "shaft = [0, 0, 0]\n", ":5: key tool[0].key[0].shaft",
                "no direction"},
        Refused{"VerbUnknown", TOOL KEY0 "verb = \"sew\"\n", ":5: key tool[0].key[0].verb",
                "\"none\", \"push\", \"grasp\", \"cut\""},
        Refused{"VerbNumber", TOOL KEY0 "verb = 1\n", ":5: key tool[0].key[0].verb", "known words"},
        Refused{"RadiusSmall", TOOL "radius_mm = 0.4\n" KEY0, ":2: key tool[0].radius_mm",
                "allowed are 0.5 to 50"},
        Refused{"RadiusBool", TOOL "radius_mm = true\n" KEY0, ":2: key tool[0].radius_mm",
                "is not a number"},
        Refused{"LengthLarge", TOOL "length_mm = 1001\n" KEY0, ":2: key tool[0].length_mm",
                "allowed are 10 to 1000"},
        Refused{"ReachLarge", TOOL "reach_mm = 50.5\n" KEY0, ":2: key tool[0].reach_mm",
                "allowed are 1 to 50"},
        Refused{"AnchorZero", TOOL "anchor = [0, 0, 0]\n" KEY0, ":2: key tool[0].anchor",
                "no direction"},
        Refused{"AnchorFrameAlone", TOOL "anchor_frame = \"normal\"\n" KEY0,
                ":2: key tool[0].anchor_frame", "needs an anchor"},
        Refused{"AnchorOnAlone", TOOL "anchor_on = \"ray\"\n" KEY0, ":2: key tool[0].anchor_on",
                "needs an anchor"},
        Refused{"LoopText", TOOL "loop = \"yes\"\n" KEY0, ":2: key tool[0].loop", "true nor false"},
        Refused{"LoopOneKey", TOOL "loop = true\n" KEY0, ":2: key tool[0].loop", "two keys"},
        Refused{"LoopJumps",
                TOOL "loop = true\n" KEY0 "[[tool.key]]\ntime_s = 1\nposition_mm = [0, 0, 1]\n",
                ":2: key tool[0].loop", "jump"},
        Refused{"EaseUnknown", TOOL "ease = \"cubic\"\n" KEY0, ":2: key tool[0].ease",
                "\"smooth\", \"linear\""}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(ScriptParse, LimitsAreInclusive) {
  EXPECT_TRUE(parse_script_text(TOOL "radius_mm = 0.5\nlength_mm = 1000\nreach_mm = 50\n"
                                     "[[tool.key]]\ntime_s = 0\nposition_mm = [0, 2000, 0]\n",
                                "a.toml")
                  .ok());
}

TEST(ScriptParse, AFileThatIsNotThereOrAFolderIsSaid) {
  const auto missing = parse_script("no/such/script.toml");
  ASSERT_FALSE(missing.ok());
  EXPECT_NE(missing.error().message.find("no/such/script.toml"), std::string::npos);
  EXPECT_FALSE(parse_script(std::filesystem::temp_directory_path()).ok());
}

TEST(ScriptParse, ScriptsOfTheRepositoryParse) {
  const auto folder = std::filesystem::path(TROCAR_SOURCE_DIR) / "deploy/scenes";
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".toml") continue;
    std::ifstream file(entry.path());
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    if (text.find("\n[organ]") != std::string::npos) continue;   // a scenario
    if (text.find("\n[[part]]") != std::string::npos) continue;  // an organ in parts
    const auto script = parse_script(entry.path());
    EXPECT_TRUE(script.ok()) << script.error().message;
    ++count;
  }
  EXPECT_GE(count, 3);
}

// Whatever the bytes are, the answer is a script or an error of one line.
TEST(ScriptParse, TruncatedAndDamagedTextIsAnsweredWithoutCrash) {
  std::ifstream file(std::filesystem::path(TROCAR_SOURCE_DIR) / "deploy/scenes/example.toml");
  const std::string good{std::istreambuf_iterator<char>(file), {}};
  ASSERT_TRUE(parse_script_text(good, "example.toml").ok());
  const auto check = [](const std::string& text) {
    const auto script = parse_script_text(text, "a.toml");
    if (script.ok()) {
      for (const auto& tool : script->tools) ASSERT_FALSE(tool.keys.empty());
    } else {
      ASSERT_EQ(script.error().message.rfind("a.toml", 0), 0u) << script.error().message;
    }
  };
  for (std::size_t length = 0; length < good.size(); ++length) check(good.substr(0, length));
  std::mt19937 random(7);
  for (int round = 0; round < 2000; ++round) {
    std::string damaged = good;
    for (int i = 0; i < 4; ++i)
      damaged[random() % damaged.size()] = static_cast<char>(random() % 256);
    check(damaged);
  }
}

TEST(ScriptParse, AHugeFileIsRefusedBeforeParsing) {
  const auto script = parse_script_text(std::string(kScriptFileLimitBytes + 1, '#'), "a.toml");
  ASSERT_FALSE(script.ok());
  EXPECT_NE(script.error().message.find("larger than 4 MiB"), std::string::npos);
}

}  // namespace
}  // namespace trocar::tool
