#include "tests/architecture/rules.h"

#include <algorithm>
#include <regex>
#include <set>

namespace trocar::architecture {
namespace {

constexpr std::size_t kMaxLines = 600;

// The only file of a state folder that may read a clock: it times the stages, for people.
constexpr const char* kStageTimers = "server/tissue/step/tick.cpp";

const std::set<std::string> kProtobufFolders{"proto",
                                             "server/organs/organ",
                                             "common/wire",
                                             "common/journal",
                                             "server/session/participants",
                                             "server/session/replication",
                                             "server/session/recording",
                                             "client/net",
                                             "client/replica",
                                             "client/replay"};
const std::set<std::string> kGraphicsFolders{"client/render", "client/ui", "client/app"};
const std::set<std::string> kStateFolders{"common/math",
                                          "server/tissue/world",
                                          "server/tissue/hands",
                                          "server/tissue/contact",
                                          "server/tissue/propagation",
                                          "server/tissue/dynamics",
                                          "server/tissue/cutting",
                                          "server/tissue/reduction",
                                          "server/tissue/step",
                                          "server/tissue/topology",
                                          "server/tissue/blades",
                                          "server/lab/scenario",
                                          "server/session/control"};

bool is_library_code(const SourceFile& file) {
  return file.path.starts_with("common/") || file.path.starts_with("server/") ||
         file.path.starts_with("client/");
}

std::string at(const SourceFile& file, int line) {
  return file.path + ":" + std::to_string(line) + ": ";
}

std::string folder_of_include(const std::string& target) {
  const auto slash = target.rfind('/');
  return slash == std::string::npos ? "" : target.substr(0, slash);
}

bool are_opposite_sides(const std::string& a, const std::string& b) {
  return (a.starts_with("server/") && b.starts_with("client/")) ||
         (a.starts_with("client/") && b.starts_with("server/"));
}

Breaches matching_includes(const SourceTree& tree, const std::regex& pattern,
                           const std::set<std::string>& allowed, const std::string& what) {
  Breaches breaches;
  for (const auto& file : tree.files) {
    if (!is_library_code(file) || allowed.contains(file.folder)) continue;
    for (const auto& include : file.includes)
      if (std::regex_search(include.target, pattern))
        breaches.push_back(at(file, include.line) + "includes " + include.target + ": " + what);
  }
  return breaches;
}

void check_depends(const SourceTree& tree, const std::string& name, Breaches& breaches) {
  const int layer = tree.layer_of(name);
  for (const auto& dependency : tree.folders.at(name).depends) {
    if (dependency == name) continue;  // a program and the library beside it
    const int other = tree.layer_of(dependency);
    const std::string start = name + "/CMakeLists.txt:1: DEPENDS " + dependency;
    if (other < 0)
      breaches.push_back(start + ": is not in TROCAR_LAYERS, correct the name");
    else if (other >= layer)
      breaches.push_back(start + ": is not above " + name + " in TROCAR_LAYERS, turn it around");
    else if (are_opposite_sides(name, dependency))
      breaches.push_back(start + ": server and client do not see each other, share it in common");
  }
}

}  // namespace

Breaches check_folders(const SourceTree& tree) {
  Breaches breaches;
  std::set<std::string> checked;
  for (const auto& file : tree.files) {
    if (!file.is_cpp() || !is_library_code(file)) continue;
    if (tree.layer_of(file.folder) < 0) {
      breaches.push_back(at(file, 1) + "folder " + file.folder +
                         " is not in TROCAR_LAYERS, add it at its place");
      continue;
    }
    const auto folder = tree.folders.find(file.folder);
    if (folder == tree.folders.end()) {
      breaches.push_back(at(file, 1) + "folder " + file.folder + " has no CMakeLists.txt, add one");
      continue;
    }
    const std::string name = file.path.substr(file.folder.size() + 1);
    if (!folder->second.words.contains(name))
      breaches.push_back(at(file, 1) + "is not listed in " + file.folder +
                         "/CMakeLists.txt, add it to SOURCES or HEADERS");
    if (checked.insert(file.folder).second) check_depends(tree, file.folder, breaches);
  }
  return breaches;
}

Breaches check_includes(const SourceTree& tree) {
  Breaches breaches;
  for (const auto& file : tree.files) {
    if (!is_library_code(file)) continue;
    const auto visible = tree.closure_of(file.folder);
    for (const auto& include : file.includes) {
      if (!include.is_quoted) continue;
      const std::string folder = folder_of_include(include.target);
      const std::string start = at(file, include.line) + "includes " + include.target + ": ";
      const bool is_generated = folder == "proto" && include.target.ends_with(".pb.h");
      if (are_opposite_sides(file.folder, folder))
        breaches.push_back(start + "server and client do not see each other, share it in common");
      else if (!is_generated && !tree.has_file(include.target))
        breaches.push_back(start + "no such file from the root, write the path from there");
      else if (folder != file.folder && !visible.contains(folder))
        breaches.push_back(start + folder + " is not among the DEPENDS of " + file.folder);
    }
  }
  return breaches;
}

Breaches check_net_sees_no_world(const SourceTree& tree) {
  Breaches breaches;
  static const std::set<std::string> kState{"server/tissue/topology", "server/tissue/blades",
                                            "server/tissue/world",    "server/tissue/hands",
                                            "server/tissue/contact",  "server/tissue/propagation",
                                            "server/tissue/dynamics", "server/tissue/reduction",
                                            "server/tissue/step",     "server/lab/scenario"};
  for (const auto& folder : tree.closure_of("server/session/net"))
    if (kState.contains(folder))
      breaches.push_back("server/session/net/CMakeLists.txt:1: sees " + folder +
                         " through its DEPENDS, hand it bytes instead");
  for (const auto& file : tree.files)
    for (const auto& include : file.includes)
      if (file.folder == "server/session/net" && kState.contains(folder_of_include(include.target)))
        breaches.push_back(at(file, include.line) + "includes " + include.target +
                           ": hand it bytes instead");
  return breaches;
}

Breaches check_protobuf(const SourceTree& tree) {
  return matching_includes(
      tree, std::regex("\\.pb\\.h$|^google/protobuf/"), kProtobufFolders,
      "messages end in wire, journal and their neighbours, pass plain types on");
}

Breaches check_graphics(const SourceTree& tree) {
  return matching_includes(tree, std::regex("^(GL|GLES[0-9]*|EGL|KHR|GLFW)/|imgui"),
                           kGraphicsFolders, "only the folders that draw may");
}

Breaches check_determinism(const SourceTree& tree) {
  static const std::regex kIncludes(
      "^(common/base/timing\\.h|chrono|ctime|time\\.h|sys/time\\.h|random|unordered_map|"
      "unordered_set|functional_hash|thread|mutex|Eigen/.*)$");
  // Exactly rounded by IEEE 754, so equal everywhere: sqrt, fabs, floor, ceil, trunc, isfinite...
  static const std::regex kCalls(
      "\\b(a?(sin|cos|tan)h?|atan2|exp|exp2|expm1|log|log2|log10|log1p|pow|cbrt|hypot|fma|tgamma|"
      "lgamma|erfc?)(f|l)?\\s*\\(|"
      "\\bstd::hash\\b|\\bs?rand\\s*\\(|\\bclock_gettime\\b|\\bthread_cpu_ns\\b|\\bmonotonic_ns\\b|"
      "\\butc_ns\\b");
  Breaches breaches;
  for (const auto& file : tree.files) {
    if (!kStateFolders.contains(file.folder) || !file.is_cpp()) continue;
    const bool may_time = file.path == kStageTimers;
    for (const auto& include : file.includes)
      if (std::regex_search(include.target, kIncludes) &&
          !(may_time && include.target == "common/base/timing.h"))
        breaches.push_back(at(file, include.line) + "includes " + include.target +
                           ": state may not depend on it");
    for (std::size_t i = 0; i < file.code_lines.size(); ++i) {
      std::smatch match;
      std::string rest = file.code_lines[i];
      while (std::regex_search(rest, match, kCalls)) {
        const bool is_timer = match.str().ends_with("_ns");
        if (!(may_time && is_timer))
          breaches.push_back(at(file, static_cast<int>(i) + 1) + "uses " + match.str() +
                             ": its result differs between machines or runs");
        rest = match.suffix();
      }
    }
  }
  return breaches;
}

Breaches check_files(const SourceTree& tree) {
  // In pieces, so that this file does not match itself.
  static const std::regex kMachinePath(std::string("(^|[\\s\"'`=(:,])/(ho") + "me|ro" + "ot|wo" +
                                       "rk|Us" + "ers|farm)/[A-Za-z0-9_.-]");
  Breaches breaches;
  for (const auto& file : tree.files) {
    const bool is_source = file.is_cpp() || file.path.ends_with(".ts");
    if (is_source && file.lines.size() > kMaxLines)
      breaches.push_back(at(file, static_cast<int>(file.lines.size())) + "has more than " +
                         std::to_string(kMaxLines) + " lines, split it by what it does");
    if (file.is_header() && std::none_of(file.code_lines.begin(), file.code_lines.end(),
                                         [](const auto& l) { return l == "#pragma once"; }))
      breaches.push_back(at(file, 1) + "has no #pragma once, add it");
    for (std::size_t i = 0; i < file.lines.size(); ++i)
      if (std::regex_search(file.lines[i], kMachinePath))
        breaches.push_back(at(file, static_cast<int>(i) + 1) +
                           "names a path of one machine, make it relative");
  }
  return breaches;
}

}  // namespace trocar::architecture
