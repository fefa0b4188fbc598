#include "tests/architecture/rules.h"

#include <algorithm>
#include <map>
#include <regex>
#include <set>

namespace trocar::architecture {
namespace {

constexpr std::size_t kMaxLines = 600;

// The only file of a state folder that may read a clock: it times the stages, for people.
constexpr const char* kStageTimers = "server/tissue/step/tick.cpp";

const std::set<std::string> kProtobufFolders{"proto",
                                             "server/organs/organ",
                                             "server/papers/reduction",
                                             "common/budget",
                                             "common/wire",
                                             "common/journal",
                                             "server/session/participants",
                                             "server/session/replication",
                                             "server/session/recording",
                                             "server/watch/follow",
                                             "server/watch/crowd",
                                             "server/watch/relay",
                                             "server/watch/bus",
                                             "server/watch/page",
                                             "client/net",
                                             "client/replica",
                                             "client/replay",
                                             "client/web/wasm"};
const std::set<std::string> kGraphicsFolders{"client/render", "client/ui", "client/app",
                                             "client/editor"};
// It shows organs as the client draws them and edits them as the server knows them.
const std::string kEditor = "client/editor";
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

// Server and client do not see each other; what they share sees neither. The editor sees both, and
// nobody sees it.
bool may_not_see(const std::string& from, const std::string& to) {
  const bool sees_server = to.starts_with("server/"), sees_client = to.starts_with("client/");
  return (from.starts_with("server/") && sees_client) ||
         (from.starts_with("client/") && from != kEditor && sees_server) ||
         (from.starts_with("common/") && (sees_server || sees_client)) ||
         (from != kEditor && to == kEditor);
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

void check_order(const SourceTree& tree, const std::string& name,
                 const std::set<std::string>& dependencies, Breaches& breaches) {
  const int layer = tree.layer_of(name);
  for (const auto& dependency : dependencies) {
    if (dependency == name) continue;  // a program and the library beside it
    const int other = tree.layer_of(dependency);
    const std::string start = name + "/CMakeLists.txt:1: depends on " + dependency;
    if (other < 0)
      breaches.push_back(start + ": is not in TROCAR_LAYERS, correct the name");
    else if (may_not_see(name, dependency))
      breaches.push_back(start +
                         ": server and client do not see each other, share it in common, which "
                         "sees neither");
    else if (other >= layer)
      breaches.push_back(start + ": is not above " + name + " in TROCAR_LAYERS, turn it around");
  }
}

// `said` and `included` must be equal; `what` is the keyword of the CMakeLists.txt.
void compare(const std::string& where, const std::string& what, const std::set<std::string>& said,
             const std::map<std::string, std::string>& included, Breaches& breaches) {
  for (const auto& [folder, place] : included)
    if (!said.contains(folder))
      breaches.push_back(place + " is of " + folder + ", which is not among the " + what + " of " +
                         where + ", add it there");
  for (const auto& folder : said)
    if (!included.contains(folder))
      breaches.push_back(where + ": " + what + " " + folder +
                         ": no include asks for it there, take it away");
}

// Folders that the files named in `files` include, each with the first place that does. Files
// beside them, in `files` or in `own`, are no dependency.
std::map<std::string, std::string> included_folders(const SourceTree& tree,
                                                    const std::string& folder,
                                                    const std::set<std::string>& files,
                                                    const std::set<std::string>& own) {
  std::map<std::string, std::string> folders;
  for (const auto& file : tree.files) {
    if (file.folder != folder || !files.contains(file.name())) continue;
    for (const auto& include : file.includes) {
      const std::string target = folder_of_include(include.target);
      if (!include.is_quoted || target.empty()) continue;
      const std::string name = include.target.substr(target.size() + 1);
      if (target == folder && (files.contains(name) || own.contains(name))) continue;
      folders.emplace(target, at(file, include.line) + include.target);
    }
  }
  return folders;
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
    if (!folder->second.lists(file.name()))
      breaches.push_back(at(file, 1) + "is not listed in " + file.folder +
                         "/CMakeLists.txt, add it to SOURCES or HEADERS");
    if (!checked.insert(file.folder).second) continue;
    if (folder->second.about.empty())
      breaches.push_back(file.folder +
                         "/CMakeLists.txt:1: has no ABOUT, say in a line what the folder is for");
    std::set<std::string> dependencies = folder->second.depends;
    dependencies.insert(folder->second.uses.begin(), folder->second.uses.end());
    for (const auto& program : folder->second.programs)
      dependencies.insert(program.depends.begin(), program.depends.end());
    check_order(tree, file.folder, dependencies, breaches);
  }
  return breaches;
}

Breaches check_includes(const SourceTree& tree) {
  Breaches breaches;
  for (const auto& file : tree.files) {
    if (!is_library_code(file)) continue;
    for (const auto& include : file.includes) {
      if (!include.is_quoted) continue;
      const bool is_generated =
          include.target.starts_with("proto/") && include.target.ends_with(".pb.h");
      if (!is_generated && !tree.has_file(include.target))
        breaches.push_back(at(file, include.line) + "includes " + include.target +
                           ": no such file from the root, write the path from there");
    }
    if (file.is_header()) continue;
    const std::string own = file.path.substr(0, file.path.size() - 4) + ".h";
    if (tree.has_file(own) && (file.includes.empty() || file.includes.front().target != own))
      breaches.push_back(at(file, 1) + "does not include " + own +
                         " first, which would show that it compiles alone");
  }
  return breaches;
}

Breaches check_dependencies(const SourceTree& tree) {
  Breaches breaches;
  for (const auto& [path, folder] : tree.folders) {
    if (tree.layer_of(path) < 0 || path == "proto") continue;
    const std::string where = path + "/CMakeLists.txt";
    auto of_headers = included_folders(tree, path, folder.headers, folder.sources);
    auto of_sources = included_folders(tree, path, folder.sources, folder.headers);
    for (const auto& [name, place] : of_headers) of_sources.erase(name);
    compare(where, "DEPENDS", folder.depends, of_headers, breaches);
    compare(where, "USES", folder.uses, of_sources, breaches);
    for (const auto& program : folder.programs)
      compare(where + ", " + program.name, "DEPENDS", program.depends,
              included_folders(tree, path, program.files, {}), breaches);
  }
  return breaches;
}

Breaches check_net_sees_no_world(const SourceTree& tree) {
  Breaches breaches;
  for (const auto& folder : tree.closure_of("server/session/net"))
    if (folder.starts_with("server/"))
      breaches.push_back("server/session/net/CMakeLists.txt:1: links " + folder +
                         ", perhaps through others: hand it bytes instead");
  return breaches;
}

Breaches check_sessions_see_no_tool(const SourceTree& tree) {
  Breaches breaches;
  for (const auto& layer : tree.layers)
    for (const auto& seen : tree.closure_of(layer))
      if (!tree.offline.contains(layer) && tree.offline.contains(seen))
        breaches.push_back(layer + "/CMakeLists.txt:1: links " + seen +
                           ", perhaps through others: give it an interface of its own");
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
    if (!tree.state_folders.contains(file.folder) || !file.is_cpp()) continue;
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
