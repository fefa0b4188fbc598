// The rules count on small samples what they count in the tree.

#include "tests/architecture/size_rules.h"

#include <gtest/gtest.h>

#include <sstream>

#include "tests/architecture/declarations.h"

namespace trocar::architecture {
namespace {

SourceFile file_of(const std::string& text) {
  SourceFile file;
  file.path = "server/a/b.h";
  file.folder = "server/a";
  std::istringstream stream(without_comments(text, false));
  for (std::string line; std::getline(stream, line);) file.code_lines.push_back(line);
  return file;
}

void expect_names(const std::string& body, std::size_t methods, std::size_t members) {
  const auto read = read_declarations(file_of("namespace n {\nclass A {\n" + body + "\n};\n}\n"));
  ASSERT_FALSE(read.classes.empty()) << body;
  EXPECT_EQ(read.classes.back().name, "A") << body;
  EXPECT_EQ(read.classes.back().methods, methods) << body;
  EXPECT_EQ(read.classes.back().members, members) << body;
}

TEST(SizeRules, MethodsAreCounted) {
  expect_names("", 0, 0);
  expect_names("public: A(); explicit A(int x); ~A(); A(const A&) = delete;", 4, 0);
  expect_names("void f(); void f(int) const; static int g() { return h(1, 2); }", 3, 0);
  expect_names("explicit A(int x) : a_{x}, b_(f(x)), c_() { g(); }", 1, 0);
  expect_names("template <typename T, int kN = 3> T f(T&& t) requires C<T> { return t; }", 1, 0);
  expect_names("bool operator==(const A&) const = default; void operator()(int);", 2, 0);
  expect_names("A& operator[](int); bool operator<(const A&) const { return x; }", 2, 0);
  expect_names("std::map<int, int> f(std::map<int, int> m = {}) const noexcept;", 1, 0);
  expect_names("auto f() -> std::vector<int>; [[nodiscard]] int g(), h;", 2, 0);
  expect_names("virtual void f() = 0; void g() override; operator bool() const;", 3, 0);
}

TEST(SizeRules, MembersAreCounted) {
  expect_names("int a; float b = 1, c{2}; int d[3], e : 2;", 0, 5);
  expect_names("std::map<int, std::vector<int>> a, b; std::function<void(int, int)> c;", 0, 3);
  expect_names("static constexpr int kA = 1 << 3, kB = kA < 4; int* p = nullptr;", 0, 3);
  expect_names("std::array<int, 2> a = {1, 2}, b = f<int, 2>(3, 4); void (*call)(int, int);", 0, 3);
  expect_names("std::optional<decltype(f(1))> a; // int b;\n const char* c = \"int d;\";", 0, 2);
  expect_names("#define X int a; \\\n int b;\nint c;", 0, 1);
}

TEST(SizeRules, TypesAndFriendsAreNotCounted) {
  expect_names("using B = int; typedef int C; using D::e; static_assert(true, \"no\");", 0, 0);
  expect_names("friend class E; friend bool operator==(A, A) { return true; } friend void f();", 0,
               0);
  expect_names("enum class F : int { G, H }; enum { I, J } k; class L; struct M m;", 0, 2);
}

TEST(SizeRules, NestedClassesCountForThemselves) {
  const auto read = read_declarations(
      file_of("class A final : public B<int>, C {\n struct D { int a, b; void f(); } d;\n"
              " union { int x; };\n void g() { struct E { int z; }; }\n};\n"
              "template <>\nstruct F<G>::H { int i; };\n"));
  ASSERT_EQ(read.classes.size(), 4u);
  EXPECT_EQ(read.classes[0].name, "A::D");
  EXPECT_EQ(read.classes[0].members + read.classes[0].methods, 3u);
  EXPECT_EQ(read.classes[2].name, "A");
  EXPECT_EQ(read.classes[2].members, 1u);
  EXPECT_EQ(read.classes[2].methods, 1u);
  EXPECT_EQ(read.classes[2].line, 1);
  EXPECT_EQ(read.classes[3].name, "F::H");
}

TEST(SizeRules, FunctionsHaveLinesAndParameters) {
  const auto read = read_declarations(
      file_of("namespace {\nint f(int a, std::map<int, int> b = {{1, 2}},\n      int c) {\n"
              "  if (a) { return 1; }\n  return 2;\n}\n}\nvoid g();\nvoid A::h(void) {}\n"
              "TEST(B, C) {\n}\nconst auto kX = [](int a) { return a; };\nA::A() : b_{1} {}\n"));
  ASSERT_EQ(read.functions.size(), 4u);
  EXPECT_EQ(read.functions[0].name, "f");
  EXPECT_EQ(read.functions[0].line, 2);
  EXPECT_EQ(read.functions[0].lines, 5u);
  EXPECT_EQ(read.functions[0].parameters, 3u);
  EXPECT_EQ(read.functions[1].parameters, 0u);
  EXPECT_EQ(read.functions[2].name, "TEST");
  EXPECT_EQ(read.functions[2].lines, 2u);
}

SourceTree tree_with(std::size_t names) {
  std::string body;
  for (std::size_t i = 0; i < names; ++i) body += "int a" + std::to_string(i) + "; ";
  SourceTree tree;
  tree.files.push_back(file_of("struct A { " + body + "};\n"));
  return tree;
}

void expect_breach(const Breaches& breaches, const std::string& what) {
  ASSERT_EQ(breaches.size(), 1u);
  EXPECT_NE(breaches[0].find(what), std::string::npos) << breaches[0];
}

TEST(SizeRules, AClassThatGrowsOrShrinksIsABreach) {
  EXPECT_TRUE(check_classes(tree_with(kMostNames), {}).empty());
  expect_breach(check_classes(tree_with(kMostNames + 1), {}), "b.h:1: A has 51 names, 50 may be");
  const LargeClass large[] = {{"server/a", "A", 55, "a reason"}};
  EXPECT_TRUE(check_classes(tree_with(55), large).empty());
  expect_breach(check_classes(tree_with(56), large), "A has 56 names, 55 may be");
  expect_breach(check_classes(tree_with(54), large), "fewer than the list");
  expect_breach(check_classes(tree_with(50), large), "take it from the list");
  const LargeClass elsewhere[] = {{"server/b", "A", 55, "a reason"}};
  EXPECT_EQ(check_classes(tree_with(56), elsewhere).size(), 2u);
}

TEST(SizeRules, AFunctionMoreOrLessIsABreach) {
  SourceTree tree;
  tree.files.push_back(file_of("void f() {" + std::string(kMostLines, '\n') + "}\n" +
                               "void g(int, int, int, int, int, int, int) {}\n"));
  EXPECT_TRUE(check_functions(tree, 1, 1).empty());
  EXPECT_EQ(check_functions(tree, 0, 1).size(), 2u);
  expect_breach(check_functions(tree, 2, 1), "1 functions have more than 60 lines, and 2 may be");
  expect_breach(check_functions(tree, 1, 2), "write the smaller number");
}

}  // namespace
}  // namespace trocar::architecture
