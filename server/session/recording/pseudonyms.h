#pragma once

// Pseudonyms of people: "Person 1", "Person 2", ... in the order in which their names come.

#include <map>
#include <string>
#include <vector>

namespace trocar::recording {

class Pseudonyms {
 public:
  void add(const std::string& name);  // an empty one is nobody's
  std::size_t count() const { return names_.size(); }

  // A name that was not added stays as it is.
  std::string of_name(const std::string& name) const;
  // Replaces whole words alone; the longest name goes first.
  std::string within(const std::string& text) const;

 private:
  std::map<std::string, std::string> names_;
  std::vector<std::string> by_length_;
};

}  // namespace trocar::recording
