#pragma once

// trocar-journal assess: what people did in recorded sessions, measured and reported.

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace trocar::app {

struct AssessOptions {
  std::string path;  // a recording, or a folder of them
  std::vector<std::string> experts;
  std::string html, pdf, csv, xapi;
  std::string home_page = "http://localhost/trocar";
  double force_limit_n = 2, strain_limit = 0.3;
  bool as_json = false, measures_strain = false, has_pictures = false, has_pseudonyms = false;
};

void add_options(CLI::App& command, AssessOptions& options);
// Returns the exit code.
int assess(const AssessOptions& options);

}  // namespace trocar::app
