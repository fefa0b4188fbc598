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

  std::string name() const { return path.substr(folder.empty() ? 0 : folder.size() + 1); }
  bool is_header() const { return path.ends_with(".h"); }
  bool is_cpp() const { return path.ends_with(".h") || path.ends_with(".cpp"); }
};

// A project_program() of a folder, as its CMakeLists.txt lists it.
struct Program {
  std::string name;
  std::set<std::string> files;    // MAIN, from the folder
  std::set<std::string> depends;  // DEPENDS
};

// The CMakeLists.txt of a folder says this.
struct Folder {
  std::set<std::string> headers;  // HEADERS of its project_library(), from the folder
  std::set<std::string> sources;  // SOURCES
  std::set<std::string> depends;  // DEPENDS
  std::set<std::string> uses;     // USES
  std::string about;              // ABOUT: what the folder is for
  std::vector<Program> programs;

  bool lists(const std::string& file) const;
};

struct SourceTree {
  std::vector<std::string> layers;      // TROCAR_LAYERS, top first
  std::set<std::string> state_folders;  // TROCAR_STATE_FOLDERS
  std::set<std::string> offline;        // TROCAR_OFFLINE_FOLDERS
  std::map<std::string, Folder> folders;
  std::vector<SourceFile> files;  // by path

  // Position in `layers`, or -1.
  int layer_of(const std::string& folder) const;
  // Returns what `folder` links, directly or through others.
  std::set<std::string> closure_of(const std::string& folder) const;
  bool has_file(const std::string& path) const;
};

// Text files under `root`; hidden folders (but .ci), build, out and node_modules are left out.
SourceTree read_source_tree(const std::filesystem::path& root);

// `text` with comments blanked and, if asked, the contents of string and character literals too.
// Line breaks stay where they are.
std::string without_comments(const std::string& text, bool keeps_literals);

}  // namespace trocar::architecture
