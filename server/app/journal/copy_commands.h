#pragma once

// trocar-journal merge, trim and sign: recordings written again as others.

#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace trocar::app {

struct MergeOptions {
  std::vector<std::string> files;  // parts, and at the end the file to write
};
void add_options(CLI::App& command, MergeOptions& options);
// Returns the exit code.
int merge_parts(const MergeOptions& options);

struct TrimCommand {
  std::string file, to;
  double from_s = 0;
  std::optional<double> to_s;  // nothing: its end
};
void add_options(CLI::App& command, TrimCommand& options);
int trim_recording(const TrimCommand& options);

struct SignCommand {
  std::string file, to, key_file;
};
void add_options(CLI::App& command, SignCommand& options);
int sign_recording(const SignCommand& options);

}  // namespace trocar::app
