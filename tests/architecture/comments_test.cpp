// Comments that are no sentence are found, and the tree has none.

#include "tests/architecture/comments.h"

#include <gtest/gtest.h>

namespace trocar::architecture {
namespace {

std::size_t count_in(const std::vector<std::string>& lines) {
  SourceFile file;
  file.path = "common/base/a.h";
  file.lines = lines;
  return find_fragments(file).size();
}

TEST(Comments, AFragmentIsFound) {
  for (const char* opener :
       {"Of", "What", "Where", "Whose", "Which", "Likewise,", "Neither", "As", "So", "Else"})
    EXPECT_EQ(count_in({std::string("  // ") + opener + " the last call, which is over."}), 1u)
        << opener;
  EXPECT_EQ(count_in({"// Half of the way from a to b."}), 1u) << "no verb";
  EXPECT_EQ(count_in({"int a;", "// Of the first.", "int b;", "// Of the last."}), 2u);
  EXPECT_EQ(count_in({"// Of the first.", "//", "// It is the second paragraph."}), 1u);
}

TEST(Comments, ASentenceIsNone) {
  for (const char* text :
       {"// The queue holds nodes by layer.", "// Returns half of the way.", "// Consumer thread.",
        "// N(n) = (n + 1)(2 n^2 + 4 n + 3) / 3", "// Nodes must be ascending.",
        "int a;  // of the last call, m", "text = \"// Of no comment\";"})
    EXPECT_EQ(count_in({text}), 0u) << text;
  EXPECT_EQ(count_in({"// A long sentence goes on in a second line", "// Of which it is a part."}),
            0u);
}

TEST(Comments, AreSentences) {
  for (const auto& file : read_source_tree(TROCAR_SOURCE_DIR).files)
    for (const auto& [path, line, comment] : find_fragments(file))
      ADD_FAILURE() << path << ":" << line << ": " << comment
                    << "\nis no sentence: begin with a subject or a verb";
}

}  // namespace
}  // namespace trocar::architecture
