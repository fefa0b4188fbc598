// The rules on synthetic trees: each breach is found, and a good tree has none.

#include <gtest/gtest.h>

#include <fstream>

#include "tests/architecture/folder_table.h"
#include "tests/architecture/rules.h"

namespace trocar::architecture {
namespace {

namespace fs = std::filesystem;

class Rules : public ::testing::Test {
 protected:
  Rules() {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    root_ = fs::path(::testing::TempDir()) / (std::string("trocar_rules_") + test->name());
    fs::remove_all(root_);
    write("CMakeLists.txt",
          "set(TROCAR_LAYERS # the order\n  common/base common/math\n  proto common/wire\n"
          "  server/tissue/world server/tissue/step server/session/net\n  client/net "
          "client/render\n  client/editor)\nset(TROCAR_STATE_FOLDERS common/math "
          "server/tissue/world "
          "server/tissue/step)\n");
    library("common/base", "SOURCES a.cpp HEADERS a.h timing.h");
    write("common/base/a.h", "#pragma once\n#include <vector>\n");
    write("common/base/a.cpp", "#include \"common/base/a.h\"\n");
    write("common/base/timing.h", "#pragma once\n");
    library("common/math", "HEADERS m.h DEPENDS common/base");
    write("common/math/m.h", "#pragma once\n#include \"common/base/a.h\"\n");
    library("common/wire", "SOURCES w.cpp HEADERS w.h DEPENDS common/math USES proto LINK zstd");
    write("common/wire/w.h", "#pragma once\n#include \"common/math/m.h\"\n");
    write("common/wire/w.cpp",
          "#include \"common/wire/w.h\"\n#include \"proto/wire.pb.h\"\n#include "
          "\"common/math/m.h\"\n");
    library("server/tissue/world", "HEADERS world.h DEPENDS common/math");
    write("server/tissue/world/world.h", "#pragma once\n#include \"common/math/m.h\"\n");
    library("server/tissue/step", "SOURCES tick.cpp USES common/base");
    write("server/tissue/step/tick.cpp",
          "#include \"common/base/timing.h\"\n#include <cmath>\n// std::sin(x) is not used\n"
          "float f(float x) { return std::sqrt(x) + g(thread_cpu_ns()) + h(\"std::cos(\"); }\n");
    library("server/session/net", "SOURCES n.cpp USES common/wire");
    write("server/session/net/n.cpp", "#include \"common/wire/w.h\"\n");
    library("client/net", "SOURCES n.cpp USES proto");
    write("client/net/n.cpp", "#include \"proto/wire.pb.h\"\n");
    library("client/render", "SOURCES r.cpp");
    write("client/render/r.cpp", "#include <GLFW/glfw3.h>\n#include <imgui.h>\n");
  }
  ~Rules() override { fs::remove_all(root_); }

  void write(const std::string& path, const std::string& text) {
    fs::create_directories((root_ / path).parent_path());
    std::ofstream(root_ / path) << text;
  }
  void append(const std::string& path, const std::string& text) {
    std::ofstream(root_ / path, std::ios::app) << text;
  }
  void library(const std::string& folder, const std::string& rest) {
    write(folder + "/CMakeLists.txt", "project_library(" + folder +
                                          " # one folder\n  ABOUT \"What (it) is for.\" " + rest +
                                          ")\n");
  }
  const fs::path& root() const { return root_; }
  SourceTree tree() const { return read_source_tree(root_); }

  // Exactly one breach, which starts with `where` and contains `what`.
  static void expect_one(const Breaches& breaches, const std::string& where,
                         const std::string& what) {
    ASSERT_EQ(breaches.size(), 1u) << (breaches.empty() ? "none" : breaches.back());
    EXPECT_EQ(breaches[0].rfind(where, 0), 0u) << breaches[0];
    EXPECT_NE(breaches[0].find(what), std::string::npos) << breaches[0];
  }

 private:
  fs::path root_;
};

TEST_F(Rules, AGoodTreeHasNoBreach) {
  const auto good = tree();
  for (const auto& breaches :
       {check_folders(good), check_includes(good), check_dependencies(good),
        check_net_sees_no_world(good), check_protobuf(good), check_sessions_see_no_tool(good),
        check_graphics(good), check_determinism(good), check_files(good)})
    EXPECT_TRUE(breaches.empty()) << breaches.front();
}

TEST_F(Rules, AnIncludeOfAHeaderThatIsNotAmongTheDependsIsFound) {
  append("server/tissue/world/world.h", "#include \"common/base/a.h\"\n");
  expect_one(check_dependencies(tree()),
             "server/tissue/world/world.h:3: ", "common/base, which is not among the DEPENDS");
  // Seen through common/math is not enough, and USES is for sources.
  library("server/tissue/world", "HEADERS world.h DEPENDS common/math USES common/base");
  EXPECT_EQ(check_dependencies(tree()).size(), 2u);
  library("server/tissue/world", "HEADERS world.h DEPENDS common/math common/base");
  EXPECT_TRUE(check_dependencies(tree()).empty());
}

TEST_F(Rules, AnIncludeOfASourceThatIsNotAmongTheUsesIsFound) {
  append("client/render/r.cpp", "#include \"common/wire/w.h\"\n");
  expect_one(check_dependencies(tree()),
             "client/render/r.cpp:3: ", "common/wire, which is not among the USES");
  library("client/render", "SOURCES r.cpp DEPENDS common/wire");
  EXPECT_EQ(check_dependencies(tree()).size(), 2u) << "a source makes nothing public";
  library("client/render", "SOURCES r.cpp USES common/wire");
  EXPECT_TRUE(check_dependencies(tree()).empty());
}

TEST_F(Rules, ADependencyThatNothingIncludesIsFound) {
  library("common/math", "HEADERS m.h DEPENDS common/base USES common/base");
  expect_one(check_dependencies(tree()), "common/math/CMakeLists.txt: USES common/base", "take");
  library("common/math", "HEADERS m.h DEPENDS common/base");
  library("client/render", "SOURCES r.cpp DEPENDS common/math");
  expect_one(check_dependencies(tree()), "client/render/CMakeLists.txt: DEPENDS common/math",
             "take");
}

TEST_F(Rules, AProgramDependsOnWhatItsFilesInclude) {
  const auto program = [&](const std::string& depends) {
    library("server/tissue/step", "SOURCES tick.cpp HEADERS t.h USES common/base");
    append("server/tissue/step/CMakeLists.txt",
           "project_program(run\n  MAIN main.cpp main.h\n  DEPENDS " + depends + ")\n");
  };
  write("server/tissue/step/t.h", "#pragma once\n");
  write("server/tissue/step/main.h", "#pragma once\n#include \"common/math/m.h\"\n");
  write("server/tissue/step/main.cpp",
        "#include \"server/tissue/step/main.h\"\n#include \"server/tissue/step/t.h\"\n");
  program("server/tissue/step common/math");
  EXPECT_TRUE(check_folders(tree()).empty());
  EXPECT_TRUE(check_dependencies(tree()).empty());
  program("common/math");
  expect_one(check_dependencies(tree()),
             "server/tissue/step/main.cpp:2: ", "of server/tissue/step");
  program("server/tissue/step common/math common/base");
  expect_one(check_dependencies(tree()), "server/tissue/step/CMakeLists.txt, run: ", "common/base");
}

TEST_F(Rules, AFolderThatDoesNotSayWhatItIsForIsFound) {
  write("common/math/CMakeLists.txt",
        "project_library(common/math HEADERS m.h DEPENDS common/base)\n");
  expect_one(check_folders(tree()), "common/math/CMakeLists.txt:1: ", "ABOUT");
}

TEST_F(Rules, ADependencyThatPointsDownIsFound) {
  library("common/base", "SOURCES a.cpp HEADERS a.h timing.h USES common/math");
  expect_one(check_folders(tree()), "common/base/CMakeLists.txt:1: ", "turn it around");
}

TEST_F(Rules, ADependencyThatDoesNotExistIsFound) {
  library("server/tissue/world", "HEADERS world.h DEPENDS common/math common/maths");
  expect_one(check_folders(tree()),
             "server/tissue/world/CMakeLists.txt:1: ", "not in TROCAR_LAYERS");
}

TEST_F(Rules, ServerAndClientInEitherDirectionAreFound) {
  library("client/net", "SOURCES n.cpp USES proto server/tissue/world");
  expect_one(check_folders(tree()), "client/net/CMakeLists.txt:1: ", "do not see each other");
  library("client/net", "SOURCES n.cpp USES proto");
  library("server/session/net", "SOURCES n.cpp USES common/wire client/net");
  expect_one(check_folders(tree()), "server/session/net/CMakeLists.txt:1: ", "do not see");
}

TEST_F(Rules, TheEditorSeesServerAndClientAndNobodySeesIt) {
  library("client/editor", "HEADERS e.h DEPENDS client/render server/tissue/world");
  write("client/editor/e.h", "#pragma once\n");
  EXPECT_TRUE(check_folders(tree()).empty());
  library("client/render", "SOURCES r.cpp USES client/editor");
  expect_one(check_folders(tree()), "client/render/CMakeLists.txt:1: ", "do not see");
}

TEST_F(Rules, WhatIsSharedSeesNeitherServerNorClient) {
  library("common/wire", "SOURCES w.cpp HEADERS w.h DEPENDS common/math server/tissue/world");
  expect_one(check_folders(tree()), "common/wire/CMakeLists.txt:1: ", "sees neither");
}

TEST_F(Rules, AnIncludeThatIsNotFromTheRootIsFound) {
  append("common/wire/w.cpp", "#include \"w.h\"\n");
  expect_one(check_includes(tree()), "common/wire/w.cpp:4: ", "from the root");
}

TEST_F(Rules, ASourceThatDoesNotBeginWithItsOwnHeaderIsFound) {
  write("common/base/a.cpp", "#include <vector>\n#include \"common/base/a.h\"\n");
  expect_one(check_includes(tree()), "common/base/a.cpp:1: ", "does not include common/base/a.h");
}

TEST_F(Rules, AnIncludeInACommentIsNone) {
  append("client/render/r.cpp",
         "// #include \"common/wire/w.h\"\n/*\n#include \"nowhere.h\"\n*/\n");
  EXPECT_TRUE(check_includes(tree()).empty());
}

TEST_F(Rules, AFolderOutsideTheLayersAndAFileThatIsNotListedAreFound) {
  write("server/magic/x.cpp", "");
  expect_one(check_folders(tree()), "server/magic/x.cpp:1: ", "not in TROCAR_LAYERS");
  fs::remove_all(root() / "server/magic");
  write("common/wire/forgotten.h", "#pragma once\n");
  expect_one(check_folders(tree()), "common/wire/forgotten.h:1: ", "not listed");
}

TEST_F(Rules, NetThatLinksTheWorldThroughAnotherFolderIsFound) {
  library("server/tissue/step", "SOURCES tick.cpp USES server/tissue/world");
  library("server/session/net", "SOURCES n.cpp USES server/tissue/step");
  EXPECT_EQ(check_net_sees_no_world(tree()).size(), 2u) << "step itself and world through it";
  library("common/wire", "SOURCES w.cpp HEADERS w.h DEPENDS server/tissue/world");
  library("server/session/net", "SOURCES n.cpp USES common/wire");
  expect_one(check_net_sees_no_world(tree()), "server/session/net/CMakeLists.txt:1: ",
             "server/tissue/world, perhaps through others");
}

TEST_F(Rules, AToolThatASessionSeesIsFound) {
  append("CMakeLists.txt", "set(TROCAR_OFFLINE_FOLDERS common/math server/tissue/world)\n");
  const auto breaches = check_sessions_see_no_tool(tree());
  ASSERT_EQ(breaches.size(), 2u) << "wire, and net through it";
  EXPECT_EQ(breaches[0],
            "common/wire/CMakeLists.txt:1: links common/math, perhaps through others: "
            "give it an interface of its own");
}

TEST_F(Rules, TheTableOfFoldersFollowsTheLayers) {
  const std::string table = folder_table(tree());
  EXPECT_NE(table.find("## `server/tissue`\n\n| folder | purpose | state |\n|---|---|---|\n"
                       "| `server/tissue/world` | What (it) is for. | x |\n"),
            std::string::npos)
      << table;
  EXPECT_NE(table.find("| `common/base` | What (it) is for. |  |\n"), std::string::npos) << table;
}

TEST_F(Rules, ProtobufElsewhereIsFound) {
  append("server/tissue/step/tick.cpp", "#include \"proto/wire.pb.h\"\n");
  expect_one(check_protobuf(tree()), "server/tissue/step/tick.cpp:5: ", "plain types");
  append("server/session/net/n.cpp", "#include <google/protobuf/message.h>\n");
  EXPECT_EQ(check_protobuf(tree()).size(), 2u);
}

TEST_F(Rules, DrawingElsewhereIsFound) {
  for (const char* header : {"<GL/gl.h>", "<EGL/egl.h>", "<GLFW/glfw3.h>", "<imgui.h>",
                             "<backends/imgui_impl_glfw.h>"}) {
    write("client/net/n.cpp", std::string("#include ") + header + "\n");
    expect_one(check_graphics(tree()), "client/net/n.cpp:1: ", "draw");
  }
}

TEST_F(Rules, EverySourceOfNondeterminismIsFound) {
  for (const char* line :
       {"#include <unordered_map>", "#include <unordered_set>", "#include <random>",
        "#include <chrono>", "#include <ctime>", "#include \"common/base/timing.h\"",
        "#include <Eigen/Dense>", "x = std::sin(y);", "x = cosf(y);", "x = std::atan2(y, z);",
        "x = std::exp(y);", "x = pow (y, 2);", "x = std::fma(a, b, c);",
        "auto h = std::hash<int>{};", "x = rand();", "t = thread_cpu_ns();",
        "clock_gettime(c, &t);"}) {
    write("server/tissue/world/world.h", std::string("#pragma once\n") + line + "\n");
    expect_one(check_determinism(tree()), "server/tissue/world/world.h:2: ", ":");
  }
}

TEST_F(Rules, ExactlyRoundedFunctionsAndLikeNamesAreAllowed) {
  write("server/tissue/world/world.h",
        "#pragma once\nx = std::sqrt(a) + std::abs(b) + std::floor(c) + position(d) + "
        "expand(e) + log_it(f) + distance(g) + cosine_of(h) + 1'000;\n");
  EXPECT_TRUE(check_determinism(tree()).empty());
}

TEST_F(Rules, OnlyTheStageTimersMayReadAClock) {
  library("server/tissue/step", "SOURCES tick.cpp other.cpp USES common/base");
  write("server/tissue/step/other.cpp", "#include \"common/base/timing.h\"\n");
  expect_one(check_determinism(tree()), "server/tissue/step/other.cpp:1: ", "timing.h");
}

TEST_F(Rules, LongFilesMachinePathsAndMissingGuardsAreFound) {
  write("common/base/a.h", "#include <vector>\n");
  expect_one(check_files(tree()), "common/base/a.h:1: ", "#pragma once");
  write("common/base/a.h", "#pragma once\n");
  write("common/base/a.cpp", std::string(601, '\n'));
  expect_one(check_files(tree()), "common/base/a.cpp:601: ", "600 lines");
  write("common/base/a.cpp", std::string(600, '\n'));
  EXPECT_TRUE(check_files(tree()).empty());
  write("deploy/start", std::string("cd /ho") + "me/somebody/trocar\n");
  expect_one(check_files(tree()), "deploy/start:1: ", "one machine");
  write("deploy/start", "cd /usr/share/trocar && cat out/work/x\n");
  EXPECT_TRUE(check_files(tree()).empty());
}

TEST(WithoutComments, KeepsLinesAndSeesThroughLiterals) {
  EXPECT_EQ(without_comments("a // b\nc", false), "a     \nc");
  EXPECT_EQ(without_comments("a /* b\nc */ d", false), "a     \n     d");
  EXPECT_EQ(without_comments("\"// no\" x // yes", true), "\"// no\" x       ");
  EXPECT_EQ(without_comments("\"a\\\"b\" c", false), "\"    \" c");
  EXPECT_EQ(without_comments("R\"x(\"//)x\" y", false), "R\"     )x\" y");
  EXPECT_EQ(without_comments("10'000 // x", false), "10'000     ");
}

}  // namespace
}  // namespace trocar::architecture
