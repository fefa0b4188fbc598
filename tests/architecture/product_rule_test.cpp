// Papers' own methods and off-line tools stay out of what a session runs.

#include "tests/architecture/product_rule.h"

#include <gtest/gtest.h>

namespace trocar::architecture {
namespace {

TEST(ProductRule, TheTreeKeepsIt) {
  const auto tree = read_source_tree(TROCAR_SOURCE_DIR);
  ASSERT_GE(tree.layer_of("server/papers/nakao"), 0);
  ASSERT_GE(tree.layer_of("server/app/server"), 0);
  for (const auto& breach : check_product_sees_no_paper(tree)) ADD_FAILURE() << breach;
}

SourceTree small_tree(const std::string& folder, const std::string& included) {
  SourceTree tree;
  tree.layers = {"server/papers/nakao", "server/lab/fit", folder};
  SourceFile file;
  file.path = folder + "/a.cpp";
  file.folder = folder;
  file.includes.push_back({3, included, true});
  tree.files.push_back(file);
  return tree;
}

TEST(ProductRule, AnIncludeOfAPaperIsFound) {
  for (const char* folder :
       {"common/base", "server/organs/mesh", "server/tissue/cutting", "server/session/net",
        "server/app/server", "server/app/journal", "client/net"}) {
    const auto breaches =
        check_product_sees_no_paper(small_tree(folder, "server/papers/nakao/explicit_euler.h"));
    ASSERT_EQ(breaches.size(), 1u) << folder;
    EXPECT_EQ(breaches[0].rfind(std::string(folder) + "/a.cpp:3: ", 0), 0u) << breaches[0];
    EXPECT_EQ(check_product_sees_no_paper(small_tree(folder, "server/lab/fit/fit.h")).size(), 1u);
  }
}

TEST(ProductRule, ToolsAndPapersMaySeeThem) {
  for (const char* folder :
       {"server/app/organ", "server/app/sim", "server/lab/scenario", "server/papers/dogan"})
    EXPECT_TRUE(
        check_product_sees_no_paper(small_tree(folder, "server/papers/nakao/explicit_euler.h"))
            .empty())
        << folder;
}

TEST(ProductRule, ADependencyThroughAnotherFolderIsFound) {
  SourceTree tree;
  tree.layers = {"server/papers/nakao", "server/session/control", "server/app/server"};
  tree.folders["server/session/control"].depends = {"server/papers/nakao"};
  tree.folders["server/app/server"].depends = {"server/session/control"};
  EXPECT_EQ(check_product_sees_no_paper(tree).size(), 2u);
}

}  // namespace
}  // namespace trocar::architecture
