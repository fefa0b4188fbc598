#include "tests/architecture/comments.h"

#include <algorithm>
#include <cctype>
#include <set>
#include <sstream>

namespace trocar::architecture {
namespace {

// A comment of fewer words may be a label: "Consumer thread."
constexpr std::size_t kLeastWords = 4;

const std::set<std::string> kOpeners{"As",    "Else",  "Likewise", "Neither", "Nor",
                                     "Of",    "So",    "Than",     "That",    "Whence",
                                     "Where", "Which", "Whose",    "What"};
// Finite verbs that do not end in s or ed, and imperatives with which comments begin.
const std::set<std::string> kVerbs{
    "add",   "allow",  "append", "bring",   "build",  "carry",  "contain", "differ", "exist",
    "grow",  "happen", "refuse", "replace", "am",     "are",    "ask",     "be",     "become",
    "began", "begin",  "belong", "call",    "came",   "can",    "cannot",  "come",   "compare",
    "could", "count",  "cut",    "did",     "do",     "fall",   "fell",    "find",   "follow",
    "gave",  "get",    "give",   "go",      "had",    "have",   "hold",    "keep",   "kept",
    "know",  "lay",    "leave",  "left",    "let",    "lie",    "lost",    "made",   "make",
    "may",   "mean",   "meet",   "met",     "might",  "move",   "must",    "need",   "pass",
    "press", "put",    "read",   "reach",   "remain", "return", "run",     "said",   "saw",
    "say",   "see",    "send",   "sent",    "set",    "shall",  "should",  "show",   "stand",
    "start", "stay",   "stood",  "take",    "tell",   "told",   "took",    "try",    "turn",
    "use",   "want",   "went",   "were",    "will",   "work",   "would",   "write",  "wrote",
    "don't", "isn't",  "it's"};

// The text of the line's comment if the line holds nothing else.
bool is_comment_line(const std::string& line, std::string& text) {
  const auto at = line.find_first_not_of(' ');
  if (at == std::string::npos || line.compare(at, 2, "//") != 0) return false;
  text = line.substr(at + 2);
  if (!text.empty() && text.front() == ' ') text.erase(0, 1);
  return true;
}

std::vector<std::string> words_of(const std::string& text) {
  std::vector<std::string> words;
  std::istringstream stream(text);
  for (std::string word; stream >> word;) {
    const auto is_letter = [](char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; };
    while (!word.empty() && !is_letter(word.back())) word.pop_back();
    while (!word.empty() && !is_letter(word.front())) word.erase(0, 1);
    if (!word.empty()) words.push_back(word);
  }
  return words;
}

bool can_be_verb(std::string word) {
  for (auto& c : word) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return word.ends_with('s') || word.ends_with("ed") || kVerbs.contains(word);
}

bool is_fragment(const std::string& paragraph) {
  const auto words = words_of(paragraph);
  if (words.size() < 2) return false;
  if (kOpeners.contains(words.front())) return true;
  const bool is_formula = paragraph.find('=') != std::string::npos;
  return words.size() >= kLeastWords && !is_formula && std::ranges::none_of(words, can_be_verb);
}

}  // namespace

std::vector<Fragment> find_fragments(const SourceFile& file) {
  std::vector<Fragment> fragments;
  if (!file.is_cpp()) return fragments;
  for (std::size_t i = 0; i < file.lines.size();) {
    std::string text, paragraph;
    const std::size_t first = i;
    bool has_ended = false;  // the first paragraph
    for (; i < file.lines.size() && is_comment_line(file.lines[i], text); ++i) {
      has_ended = has_ended || text.empty();
      if (!has_ended) paragraph += text + ' ';
    }
    if (i == first) ++i;
    if (is_fragment(paragraph))
      fragments.push_back({file.path, static_cast<int>(first) + 1, paragraph});
  }
  return fragments;
}

}  // namespace trocar::architecture
