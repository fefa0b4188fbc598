#pragma once

// The source tree as the rules see it: layers and dependencies from the CMake files, text and
// includes of every source file. Read from disk, so that the rules can be tried on synthetic trees.

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace trocar::architecture {

struct Include {
  int line = 0;           // from 1
  std::string target;     // as written between the quotes or brackets
  bool is_quoted = true;  // "..." against <...>
};

struct SourceFile {
  std::string path;    // from the root, with '/'
  std::string folder;  // of the file: "server/tissue/contact", "proto", "tests/script"
  std::vector<std::string> lines;
  std::vector<std::string> code_lines;  // without comments and contents of literals; C++ only
  std::vector<Include> includes;        // C++ only

  bool is_header() const { return path.ends_with(".h"); }
  bool is_cpp() const { return path.ends_with(".h") || path.ends_with(".cpp"); }
};

struct Folder {
  std::set<std::string> depends;  // as written in its CMakeLists.txt
  std::set<std::string> words;    // every word of that file
};

struct SourceTree {
  std::vector<std::string> layers;  // TROCAR_LAYERS, top first
  std::map<std::string, Folder> folders;
  std::vector<SourceFile> files;  // by path

  // Position in `layers`, or -1.
  int layer_of(const std::string& folder) const;
  // What `folder` may see through its DEPENDS, directly or through others.
  std::set<std::string> closure_of(const std::string& folder) const;
  bool has_file(const std::string& path) const;
};

// Text files under `root`; hidden folders (but .ci), build, out and node_modules are left out.
SourceTree read_source_tree(const std::filesystem::path& root);

// `text` with comments blanked and, if asked, the contents of string and character literals too.
// Line breaks stay where they are.
std::string without_comments(const std::string& text, bool keeps_literals);

}  // namespace trocar::architecture
