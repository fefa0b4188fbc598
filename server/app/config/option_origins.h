#pragma once

// Options come from the command line or from a configuration file. Errors say from where.

#include <map>
#include <string>

namespace trocar::app {

class OptionOrigins {
 public:
  void read_from(const std::string& file) { file_ = file; }
  void add(const std::string& key, int line) { lines_[key] = line; }
  // "lesson.toml:3: key budget", or "--budget" for one that was typed.
  std::string place_of(const std::string& key) const;
  // The message with the place of the option at its beginning, if it begins with one
  // ("--budget...").
  std::string placed(const std::string& message) const;

 private:
  std::string file_;
  std::map<std::string, int> lines_;
};

}  // namespace trocar::app
