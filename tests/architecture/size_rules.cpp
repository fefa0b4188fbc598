#include "tests/architecture/size_rules.h"

#include <algorithm>
#include <set>

#include "tests/architecture/declarations.h"

namespace trocar::architecture {
namespace {

std::string place_of(const SourceFile& file, int line) {
  return file.path + ":" + std::to_string(line) + ": ";
}

// `places` are those that break a limit; `allowed` is how many may.
void compare_count(const std::string& what, const Breaches& places, std::size_t allowed,
                   Breaches& breaches) {
  if (places.size() == allowed) return;
  breaches.push_back(std::to_string(places.size()) + " " + what + ", and " +
                     std::to_string(allowed) + " may be: " +
                     (places.size() < allowed ? "write the smaller number in architecture_test.cpp"
                                              : "make a new one smaller"));
  if (places.size() > allowed) breaches.insert(breaches.end(), places.begin(), places.end());
}

}  // namespace

Breaches check_classes(const SourceTree& tree, std::span<const LargeClass> large) {
  Breaches breaches;
  std::set<const LargeClass*> found;
  for (const auto& file : tree.files) {
    if (!file.is_cpp()) continue;
    for (const auto& one : read_declarations(file).classes) {
      const auto names = one.methods + one.members;
      const auto entry = std::ranges::find_if(large, [&](const LargeClass& l) {
        return l.folder == file.folder && l.name == one.name;
      });
      const bool is_listed = entry != large.end();
      if (is_listed) found.insert(&*entry);
      const std::string says =
          place_of(file, one.line) + one.name + " has " + std::to_string(names) + " names, ";
      if (names > (is_listed ? entry->names : kMostNames))
        breaches.push_back(says + std::to_string(is_listed ? entry->names : kMostNames) +
                           " may be: give a part of it a name of its own");
      else if (is_listed && names <= kMostNames)
        breaches.push_back(says + "which is few: take it from the list of large classes");
      else if (is_listed && names < entry->names)
        breaches.push_back(says + "fewer than the list of large classes says: write that there");
    }
  }
  for (const auto& entry : large)
    if (!found.contains(&entry))
      breaches.push_back(std::string(entry.folder) + ": has no class " + std::string(entry.name) +
                         ", take it from the list of large classes");
  return breaches;
}

Breaches check_functions(const SourceTree& tree, std::size_t long_functions,
                         std::size_t wide_functions) {
  Breaches breaches, are_long, are_wide;
  for (const auto& file : tree.files) {
    if (!file.is_cpp()) continue;
    for (const auto& one : read_declarations(file).functions) {
      const std::string start = place_of(file, one.line) + one.name + " ";
      if (one.lines > kMostLines)
        are_long.push_back(start + "has " + std::to_string(one.lines) + " lines");
      if (one.parameters > kMostParameters)
        are_wide.push_back(start + "takes " + std::to_string(one.parameters) + " parameters");
    }
  }
  compare_count("functions have more than " + std::to_string(kMostLines) + " lines", are_long,
                long_functions, breaches);
  compare_count("functions take more than " + std::to_string(kMostParameters) + " parameters",
                are_wide, wide_functions, breaches);
  return breaches;
}

}  // namespace trocar::architecture
