// The validation report in its short form, as a process: the files are well formed and the bounds
// of the quick experiments are kept.

#include <google/protobuf/struct.pb.h>
#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

namespace trocar {
namespace {

namespace fs = std::filesystem;
using google::protobuf::ListValue;
using google::protobuf::Value;

std::string read(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

class Validation : public ::testing::Test {
 protected:
  ~Validation() override { fs::remove_all(folder_); }

  int run(const std::string& arguments) {
    fs::create_directories(folder_);
    const std::string command = std::string(TROCAR_BINARY_DIR) + "/trocar-validate --out '" +
                                (folder_ / "out").string() + "' " + arguments + " >'" +
                                (folder_ / "log").string() + "' 2>&1";
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string log() const { return read(folder_ / "log"); }
  fs::path out() const { return folder_ / "out"; }

  // Checks the form of results.json and that every bound is kept; names of the checks.
  std::set<std::string> kept_checks() const {
    std::set<std::string> names;
    ListValue list;
    const auto status =
        google::protobuf::util::JsonStringToMessage(read(out() / "results.json"), &list);
    EXPECT_TRUE(status.ok()) << status.ToString();
    for (const auto& entry : list.values()) {
      const auto& fields = entry.struct_value().fields();
      for (const char* key : {"name", "paper", "ours", "error", "bound", "kept", "note"})
        EXPECT_TRUE(fields.contains(key)) << key;
      EXPECT_EQ(fields.size(), 7u);
      if (fields.size() != 7u) continue;
      const std::string name = fields.at("name").string_value();
      EXPECT_TRUE(names.insert(name).second) << name << " twice";
      EXPECT_EQ(fields.at("error").kind_case(), Value::kNumberValue) << name;
      EXPECT_EQ(fields.at("bound").kind_case(), Value::kNumberValue) << name;
      EXPECT_EQ(fields.at("kept").bool_value(),
                fields.at("error").number_value() <= fields.at("bound").number_value())
          << name;
      EXPECT_TRUE(fields.at("kept").bool_value())
          << name << ": error " << fields.at("error").number_value() << ", bound "
          << fields.at("bound").number_value();
    }
    return names;
  }

 private:
  const fs::path folder_ =
      fs::temp_directory_path() / ("trocar-validation-" + std::to_string(getpid()) + "-" +
                                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(Validation, CountsAreThoseOfThePaper) {
  ASSERT_EQ(run("--short --only choi2002/eq2"), 0) << log();
  const auto names = kept_checks();
  EXPECT_TRUE(names.contains("choi2002/eq2/depth-10"));
  EXPECT_EQ(names.size(), 3u);

  const std::string html = read(out() / "report.html");
  EXPECT_TRUE(html.starts_with("<!doctype html>"));
  EXPECT_TRUE(html.ends_with("</html>\n"));
  EXPECT_NE(html.find("3 of 3 bounds kept"), std::string::npos);
  EXPECT_NE(html.find("[[force]]"), std::string::npos) << "the scenario is in the report";
  EXPECT_EQ(html.find("http-equiv"), std::string::npos);
  EXPECT_EQ(html.find("<script"), std::string::npos);
  EXPECT_EQ(html.find("<link"), std::string::npos) << "self-contained";
  EXPECT_TRUE(fs::exists(out() / "scenarios" / "eq2-surface-10.toml"));
}

TEST_F(Validation, MaterialsFollowTheirClosedForms) {
  ASSERT_EQ(run("--short --only choi2002/fig4"), 0) << log();
  EXPECT_EQ(kept_checks().size(), 3u);
  EXPECT_NE(read(out() / "report.html").find("<svg"), std::string::npos);
  ASSERT_EQ(run("--short --only choi2002/relaxation"), 0) << log();
  EXPECT_EQ(kept_checks().size(), 3u);
}

TEST_F(Validation, JointRegionsActAsOne) {
  ASSERT_EQ(run("--short --only choi2002/fig2"), 0) << log();
  EXPECT_EQ(kept_checks().size(), 3u);
}

TEST_F(Validation, BarInTensionHasItsClosedForm) {
  ASSERT_EQ(run("--short --only ours/bar"), 0) << log();
  EXPECT_TRUE(kept_checks().contains("ours/bar/springs"));
}

TEST_F(Validation, ACutPlateGapesAsInThePaper) {
  ASSERT_EQ(run("--short --only nakao2003/plate"), 0) << log();
  const auto names = kept_checks();
  EXPECT_TRUE(names.contains("nakao2003/plate/adaptive-below-plain-6"));
  EXPECT_TRUE(names.contains("nakao2003/plate/energy-plain"));
}

TEST_F(Validation, TheLargeCaseStaysSoundWhileABladeCuts) {
  ASSERT_EQ(run("--short --only nakao2003/fig15-fig17-cutting"), 0) << log();
  EXPECT_EQ(kept_checks().size(), 6u);
}

TEST_F(Validation, TheOffLineSolverMeetsCalculix) {
  ASSERT_EQ(run("--short --only dogan2011/calculix"), 0) << log();
  const auto names = kept_checks();
  if (read(out() / "report.html").find("LEFT OUT: ccx is not installed") != std::string::npos)
    GTEST_SKIP() << "ccx is not installed (package calculix-ccx)";
  EXPECT_EQ(names.size(), 4u);
}

TEST_F(Validation, AveragedStrainLosesLessThanPlainTets) {
  ASSERT_EQ(run("--short --only dogan2011/locking"), 0) << log();
  const auto names = kept_checks();
  EXPECT_TRUE(names.contains("dogan2011/locking/cook-plain-locks"));
  EXPECT_TRUE(names.contains("dogan2011/locking/pressure-is-smooth"));
  EXPECT_EQ(names.size(), 11u);
}

TEST_F(Validation, AMeasuredLiverCreepsLiveAsOffLine) {
  ASSERT_EQ(run("--short --only dogan2011/creep"), 0) << log();
  const auto names = kept_checks();
  EXPECT_TRUE(names.contains("dogan2011/creep/liver-live"));
  EXPECT_EQ(names.size(), 8u);
}

TEST_F(Validation, AMeasuredLiverPressedLiveIsNearItsConvergedSolution) {
  ASSERT_EQ(run("--short --only dogan2011/live"), 0) << log();
  const auto names = kept_checks();
  EXPECT_TRUE(names.contains("dogan2011/live/liver-averaged-force"));
  EXPECT_EQ(names.size(), 4u);
}

TEST_F(Validation, AReducedLiverErrsAsThePaperSays) {
  ASSERT_EQ(run("--short --only dogan2011/reduction"), 0) << log();
  const auto names = kept_checks();
  EXPECT_TRUE(names.contains("dogan2011/reduction/liver-own-load-best"));
  EXPECT_EQ(names.size(), 7u);
}

TEST_F(Validation, ALocalReductionIsNearTheFullModel) {
  ASSERT_EQ(run("--short --only ours/local-reduction"), 0) << log();
  const auto names = kept_checks();
  EXPECT_TRUE(names.contains("ours/local-reduction/liver-2-layers-unseen-force"));
  EXPECT_EQ(names.size(), 7u);
}

TEST_F(Validation, SessionsThatALocalReductionMovesAreNearConvergedOnes) {
  ASSERT_EQ(run("--short --only ours/live-reduction"), 0) << log();
  const auto names = kept_checks();
  EXPECT_TRUE(names.contains("ours/live-reduction/sessions/liver-unseen-force"));
  EXPECT_TRUE(names.contains("ours/live-reduction/hand-over/liver-jump"));
  EXPECT_TRUE(names.contains("ours/live-reduction/estimate/liver-missed"));
  EXPECT_TRUE(names.contains("ours/live-reduction/sizes/4k-force"));
  EXPECT_EQ(names.size(), 13u);
  EXPECT_TRUE(fs::exists(out() / "scenarios" / "live-estimate.csv"));
}

TEST_F(Validation, CommandLine) {
  EXPECT_EQ(run("--help"), 0);
  EXPECT_NE(log().find("Examples:"), std::string::npos);
  EXPECT_EQ(run("--list"), 0);
  EXPECT_NE(log().find("choi2002/fig5-profiles"), std::string::npos);
  EXPECT_EQ(run("--only nothing/like-this"), 2);
  EXPECT_NE(log().find("--list"), std::string::npos);
  EXPECT_EQ(run("--unknown"), 2);
}

}  // namespace
}  // namespace trocar
