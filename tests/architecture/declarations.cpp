#include "tests/architecture/declarations.h"

#include <algorithm>
#include <cctype>
#include <set>
#include <string_view>

namespace trocar::architecture {
namespace {

struct Token {
  std::string text;
  int line = 0;

  bool is_word() const {
    return std::isalpha(static_cast<unsigned char>(text[0])) || text[0] == '_';
  }
};

bool is_part_of_word(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
}

// Words and numbers, "::", "->", "<<" and single characters. Lines of the preprocessor are left
// out.
std::vector<Token> tokens_of(const std::vector<std::string>& code_lines) {
  std::vector<Token> tokens;
  bool goes_on = false;  // a line of the preprocessor
  for (std::size_t number = 0; number < code_lines.size(); ++number) {
    const std::string& line = code_lines[number];
    const auto start = line.find_first_not_of(" \t");
    if (start == std::string::npos) continue;
    const bool is_directive = goes_on || line[start] == '#';
    goes_on = is_directive && line.back() == '\\';
    for (auto i = is_directive ? line.size() : start; i < line.size();) {
      std::size_t length = 1;
      if (is_part_of_word(line[i]))
        while (i + length < line.size() && is_part_of_word(line[i + length])) ++length;
      else if (const auto two = std::string_view(line).substr(i, 2);
               two == "::" || two == "->" || two == "<<")
        length = 2;
      if (line[i] != ' ' && line[i] != '\t')
        tokens.push_back({line.substr(i, length), static_cast<int>(number) + 1});
      i += length;
    }
  }
  return tokens;
}

class Reader {
 public:
  explicit Reader(const std::vector<std::string>& code_lines) : tokens_(tokens_of(code_lines)) {}

  Declarations read() {
    read_scope("", nullptr);
    return std::move(read_);
  }

 private:
  bool at_end() const { return at_ >= tokens_.size(); }
  bool is(std::string_view text) const { return !at_end() && tokens_[at_].text == text; }
  bool takes(std::string_view text) {
    if (!is(text)) return false;
    ++at_;
    return true;
  }

  // From an opening token to behind the one that closes it.
  void skip_group() {
    int depth = 0;
    for (; !at_end(); ++at_) {
      const char c = tokens_[at_].text[0];
      if (c == '(' || c == '[' || c == '{') ++depth;
      if ((c == ')' || c == ']' || c == '}') && --depth == 0) break;
    }
    ++at_;
  }
  void skip_angles() {
    int depth = 0;
    while (!at_end()) {
      if (is("(") || is("[") || is("{")) {
        skip_group();
        continue;
      }
      depth += is("<") ? 1 : is(">") ? -1 : 0;
      ++at_;
      if (depth == 0) return;
    }
  }
  void skip_to_semicolon() {
    while (!at_end() && !is(";")) is("(") || is("[") || is("{") ? skip_group() : void(++at_);
    ++at_;
  }

  // Up to behind the brace that closes it, or to the end of the file. `around` counts the names, if
  // it is a class.
  void read_scope(const std::string& prefix, ClassRead* around) {
    while (!at_end() && !takes("}")) read_declaration(prefix, around);
  }

  void read_declaration(const std::string& prefix, ClassRead* around) {
    if (takes(";")) return;
    if (is("public") || is("private") || is("protected")) return void(at_ += 2);
    if (takes("template")) return skip_angles();  // and then what it is a template of
    if (is("namespace")) return read_namespace();
    if (is("friend")) return read_friend();
    if (is("using") || is("typedef") || is("static_assert")) return skip_to_semicolon();
    if (takes("enum")) {
      while (!at_end() && !is("{") && !is(";")) ++at_;
      if (is("{")) skip_group();
      return read_declarators(around);
    }
    const bool may_be_class = is("class") || is("struct") || is("union");
    if (may_be_class && read_class(prefix)) return read_declarators(around);
    read_function_or_variable(around);
  }

  void read_namespace() {
    while (!at_end() && !is("{") && !is(";") && !is("=")) ++at_;
    if (!takes("{")) return skip_to_semicolon();
    read_scope("", nullptr);
  }
  void read_friend() {
    while (!at_end() && !is(";") && !is("{")) is("(") ? skip_group() : void(++at_);
    is("{") ? skip_group() : skip_to_semicolon();
  }

  // Returns false, and stays where it is, if no class is declared here.
  bool read_class(const std::string& prefix) {
    const auto start = at_;
    ClassRead found{.name = prefix, .line = tokens_[at_++].line};
    while (is("[") || is("alignas")) ++at_, skip_group();
    for (bool goes_on = true; goes_on && !at_end() && !is("{") && !is(":");) {
      found.name += tokens_[at_++].text;
      if (is("<")) skip_angles();
      goes_on = takes("::");
      if (goes_on) found.name += "::";
    }
    if (is(";")) return true;  // It is defined elsewhere.
    takes("final");
    if (takes(":"))
      while (!at_end() && !is("{")) is("<") ? skip_angles() : void(++at_);
    if (!takes("{")) {
      at_ = start;
      return false;
    }
    read_scope(found.name + "::", &found);
    read_.classes.push_back(found);
    return true;
  }

  // Reads what stands behind the brace of a type, up to the semicolon.
  void read_declarators(ClassRead* around) {
    std::size_t names = is(";") ? 0 : 1;
    while (!at_end() && !is(";")) {
      if (is(",")) ++names;
      is("(") || is("[") || is("{") ? skip_group() : void(++at_);
    }
    takes(";");
    if (around) around->members += names;
  }

  void read_function_or_variable(ClassRead* around) {
    std::size_t names = 1;
    for (std::string before; !at_end(); before = tokens_[at_ - 1].text) {
      if (takes(";")) {
        if (around) around->members += names;
        return;
      }
      if (is("}")) return;  // text that this does not understand
      if (takes("operator")) {
        if (is("(")) skip_group();
        while (!at_end() && !is("(")) ++at_;
        return read_function("operator", around);
      }
      if (is("(") && is_name(before) && !is_followed_by("*")) return read_function(before, around);
      if (is(",")) ++names;
      if (is("=")) {
        skip_initialiser();
      } else if (is("<") && is_part_of_word(before.empty() ? ' ' : before.back())) {
        skip_angles();
      } else if (is("(") || is("[") || is("{")) {
        skip_group();
      } else {
        ++at_;
      }
    }
  }
  bool is_followed_by(std::string_view text) const {
    return at_ + 1 < tokens_.size() && tokens_[at_ + 1].text == text;
  }
  static bool is_name(const std::string& word) {
    static const std::set<std::string> kOthers{"decltype", "alignas",  "explicit",
                                               "noexcept", "requires", "return"};
    return !word.empty() && is_part_of_word(word[0]) && !kOthers.contains(word);
  }
  // Up to the comma or semicolon behind it. An angle that opens behind a word and closes before
  // that is one of a template.
  void skip_initialiser() {
    while (!at_end() && !is(",") && !is(";") && !is("}")) {
      const bool may_be_template = is("<") && tokens_[at_ - 1].is_word();
      if (may_be_template && closes_before_semicolon()) {
        skip_angles();
      } else {
        is("(") || is("[") || is("{") ? skip_group() : void(++at_);
      }
    }
  }
  bool closes_before_semicolon() const {
    for (auto i = at_; i < tokens_.size() && tokens_[i].text != ";"; ++i)
      if (tokens_[i].text == ">") return true;
    return false;
  }

  // From its parameters on.
  void read_function(const std::string& name, ClassRead* around) {
    if (around) ++around->methods;
    FunctionRead found{.name = name, .line = tokens_[at_ - 1].line};
    found.parameters = count_parameters();
    // Qualifiers, a trailing type.
    while (!at_end() && !is("{") && !is(";") && !is(":") && !is("=") && !is("}"))
      is("(") || is("[") ? skip_group() : is("<") ? skip_angles() : void(++at_);
    if (takes(":")) skip_member_initialisers();
    if (!is("{")) {
      // A macro without a semicolon, such as TEST's, has its body here or nothing.
      if (!is("}")) skip_to_semicolon();
      return;
    }
    skip_group();
    found.lines = static_cast<std::size_t>(tokens_[at_ - 1].line - found.line + 1);
    read_.functions.push_back(found);
  }
  void skip_member_initialisers() {
    while (!at_end()) {
      while (!at_end() && !is("(") && !is("{")) is("<") ? skip_angles() : void(++at_);
      skip_group();
      if (!takes(",")) return;
    }
  }
  std::size_t count_parameters() {
    const auto first = ++at_;
    std::size_t commas = 0;
    while (!at_end() && !is(")")) {
      if (is(",")) ++commas;
      if (is("<") && tokens_[at_ - 1].is_word())
        skip_angles();
      else
        is("(") || is("[") || is("{") ? skip_group() : void(++at_);
    }
    const bool is_empty = at_ == first || (at_ == first + 1 && tokens_[first].text == "void");
    takes(")");
    return is_empty ? 0 : commas + 1;
  }

  std::vector<Token> tokens_;
  std::size_t at_ = 0;
  Declarations read_;
};

}  // namespace

Declarations read_declarations(const SourceFile& file) {
  return Reader(file.code_lines).read();
}

}  // namespace trocar::architecture
