#pragma once

// Names that a file gives to parts of a surface, for which an organ has no place: a line says so.

#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace trocar::formats {

class PartNames {
 public:
  // kind: of what, such as "solids". Outer blanks are no part of a name, and blanks alone are none.
  void add(const std::string& kind, std::string_view name);
  // Adds a line for each kind, whose names are in the order of the alphabet.
  void say(std::vector<std::string>& left_out) const;

 private:
  std::map<std::string, std::set<std::string>> names_;
};

}  // namespace trocar::formats
