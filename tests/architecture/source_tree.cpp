#include "tests/architecture/source_tree.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <regex>
#include <sstream>

namespace trocar::architecture {
namespace {

namespace fs = std::filesystem;

std::string read_text(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<std::string> split_lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

bool is_text(const fs::path& path) {
  if (path.filename().string().starts_with(".")) return false;
  static const std::set<std::string> kExtensions{
      "",    ".h",   ".cpp", ".txt", ".cmake", ".md",  ".toml", ".proto", ".json",
      ".ts", ".mjs", ".js",  ".yml", ".yaml",  ".css", ".html", ".glsl"};
  return kExtensions.contains(path.extension().string());
}

bool is_left_out(const fs::path& folder) {
  const std::string name = folder.filename().string();
  return (name.starts_with(".") && name != ".ci") || name == "build" || name == "out" ||
         name == "node_modules";
}

// Words, parentheses, and quoted strings with their quotes.
std::vector<std::string> words_of_cmake(const std::string& text) {
  const std::string code = std::regex_replace(text, std::regex("#[^\n]*"), "");
  std::vector<std::string> words;
  static const std::regex kWord("[()]|\"[^\"]*\"|[^\\s()\"]+");
  for (auto it = std::sregex_iterator(code.begin(), code.end(), kWord);
       it != std::sregex_iterator(); ++it)
    words.push_back(it->str());
  return words;
}

Folder read_folder(const std::string& cmake_text) {
  static const std::set<std::string> kKeywords{"ABOUT", "SOURCES",  "HEADERS", "DEPENDS",
                                               "USES",  "LINK",     "MAIN",    "JOINED",
                                               "APART", "ON_DEMAND"};
  Folder folder;
  std::string command, keyword;
  const auto words = words_of_cmake(cmake_text);
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    if (word == "(") {
      command = i == 0 ? "" : words[i - 1];
      if (command == "project_program" && i + 1 < words.size())
        folder.programs.push_back({.name = words[i + 1], .files = {}, .depends = {}});
      keyword.clear();
    } else if (word == ")") {
      command.clear();
    } else if (kKeywords.contains(word)) {
      keyword = word;
    } else if (keyword == "ABOUT" && word.size() > 2) {
      folder.about = word.substr(1, word.size() - 2);
    } else if (command == "project_library") {
      if (keyword == "SOURCES") folder.sources.insert(word);
      if (keyword == "HEADERS") folder.headers.insert(word);
      if (keyword == "DEPENDS") folder.depends.insert(word);
      if (keyword == "USES") folder.uses.insert(word);
    } else if (command == "project_program") {
      if (keyword == "MAIN") folder.programs.back().files.insert(word);
      if (keyword == "DEPENDS") folder.programs.back().depends.insert(word);
    }
  }
  return folder;
}

// The words of set(`name` ...).
std::vector<std::string> read_list(const std::string& cmake_text, const std::string& name) {
  const auto words = words_of_cmake(cmake_text);
  auto at = std::find(words.begin(), words.end(), name);
  std::vector<std::string> list;
  for (; at != words.end() && *at != ")"; ++at)
    if (*at != name) list.push_back(*at);
  return list;
}

SourceFile read_file(const fs::path& root, const fs::path& path) {
  SourceFile file;
  file.path = path.lexically_relative(root).generic_string();
  file.folder = fs::path(file.path).parent_path().generic_string();
  const std::string text = read_text(path);
  file.lines = split_lines(text);
  if (!file.is_cpp()) return file;
  file.code_lines = split_lines(without_comments(text, false));
  static const std::regex kInclude(R"(^\s*#\s*include\s*(["<])([^">]+)[">])");
  const auto lines = split_lines(without_comments(text, true));
  for (std::size_t i = 0; i < lines.size(); ++i) {
    std::smatch match;
    if (std::regex_search(lines[i], match, kInclude))
      file.includes.push_back({static_cast<int>(i) + 1, match[2], match[1] == "\""});
  }
  return file;
}

}  // namespace

bool Folder::lists(const std::string& file) const {
  return headers.contains(file) || sources.contains(file) ||
         std::any_of(programs.begin(), programs.end(),
                     [&](const Program& program) { return program.files.contains(file); });
}

int SourceTree::layer_of(const std::string& folder) const {
  const auto at = std::find(layers.begin(), layers.end(), folder);
  return at == layers.end() ? -1 : static_cast<int>(at - layers.begin());
}

std::set<std::string> SourceTree::closure_of(const std::string& folder) const {
  std::set<std::string> seen;
  std::vector<std::string> open{folder};
  while (!open.empty()) {
    const auto at = folders.find(open.back());
    open.pop_back();
    if (at == folders.end()) continue;
    for (const auto* names : {&at->second.depends, &at->second.uses})
      for (const auto& next : *names)
        if (seen.insert(next).second) open.push_back(next);
  }
  return seen;
}

bool SourceTree::has_file(const std::string& path) const {
  return std::any_of(files.begin(), files.end(),
                     [&](const auto& file) { return file.path == path; });
}

SourceTree read_source_tree(const std::filesystem::path& root) {
  SourceTree tree;
  const std::string top = read_text(root / "CMakeLists.txt");
  tree.layers = read_list(top, "TROCAR_LAYERS");
  for (const auto& folder : read_list(top, "TROCAR_STATE_FOLDERS"))
    tree.state_folders.insert(folder);
  for (const auto& folder : read_list(top, "TROCAR_OFFLINE_FOLDERS")) tree.offline.insert(folder);
  for (auto it = fs::recursive_directory_iterator(root); it != fs::recursive_directory_iterator();
       ++it) {
    if (it->is_directory() && is_left_out(it->path())) it.disable_recursion_pending();
    if (it->is_regular_file() && is_text(it->path()))
      tree.files.push_back(read_file(root, it->path()));
    if (it->is_regular_file() && it->path().filename() == "CMakeLists.txt") {
      const auto folder = it->path().parent_path().lexically_relative(root).generic_string();
      tree.folders[folder] = read_folder(read_text(it->path()));
    }
  }
  std::sort(tree.files.begin(), tree.files.end(),
            [](const auto& a, const auto& b) { return a.path < b.path; });
  return tree;
}

std::string without_comments(const std::string& text, bool keeps_literals) {
  enum class In { Code, LineComment, BlockComment, String, Character, RawString };
  In in = In::Code;
  std::string out = text;
  std::string raw_end;
  const auto blank = [&](std::size_t i) {
    if (out[i] != '\n') out[i] = ' ';
  };
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    const char next = i + 1 < text.size() ? text[i + 1] : '\0';
    switch (in) {
      case In::Code:
        if (c == '/' && (next == '/' || next == '*')) {
          in = next == '/' ? In::LineComment : In::BlockComment;
          blank(i);
          blank(++i);
        } else if (c == '"' && i > 0 && text[i - 1] == 'R') {
          const auto open = text.find('(', i);
          if (open == std::string::npos) return out;
          raw_end = ")" + text.substr(i + 1, open - i - 1) + "\"";
          in = In::RawString;
        } else if (c == '"') {
          in = In::String;
        } else if (c == '\'' && !(i > 0 && std::isalnum(static_cast<unsigned char>(text[i - 1])))) {
          in = In::Character;  // and not the separator in 10'000
        }
        break;
      case In::LineComment:
        if (c == '\n') in = In::Code;
        blank(i);
        break;
      case In::BlockComment:
        blank(i);
        if (c == '*' && next == '/') {
          blank(++i);
          in = In::Code;
        }
        break;
      case In::String:
      case In::Character:
        if (c == (in == In::String ? '"' : '\'')) {
          in = In::Code;
        } else {
          if (!keeps_literals) blank(i);
          if (c == '\\' && ++i < text.size() && !keeps_literals) blank(i);
        }
        break;
      case In::RawString:
        if (text.compare(i, raw_end.size(), raw_end) == 0) {
          i += raw_end.size() - 1;
          in = In::Code;
        } else if (!keeps_literals) {
          blank(i);
        }
        break;
    }
  }
  return out;
}

}  // namespace trocar::architecture
