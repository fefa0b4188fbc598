#pragma once

// trocar-journal push: recordings to S3-compatible storage, or to any that rclone knows.

#include <cstdint>
#include <string>

namespace CLI {
class App;
}

namespace trocar::app {

struct PushCommand {
  std::string path;  // a recording, or a folder of them
  std::string url;   // s3://bucket/prefix, or REMOTE:path
  std::string endpoint, region;
  std::uint32_t part_mb = 16;
  bool allows_plain = false;
};
void add_options(CLI::App& command, PushCommand& options);
// Returns the exit code.
int push(const PushCommand& options);

}  // namespace trocar::app
