#pragma once

// The options of trocar-organ edit. With a window another program shows the organ
// (client/editor); it reads the same command line. So what is opened and edited by options is
// here, once.

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/organs/edit/editor.h"

namespace trocar::edit_command {

struct EditCommand {
  std::string organ;  // a built-in organ's name, or a file
  std::string unit;   // of a mesh or a surface; empty: metres
  std::optional<int> nodes;
  std::string labels;
  std::vector<std::string> releases, holds, regions, gives;
  std::string material;
  std::string out;  // empty: chosen when it is saved
  bool is_headless = false, replaces = false;
  std::string size = "1280x800";
  double scale = 0;
};

void add_options(CLI::App& app, EditCommand& command);

// Width and height of a window, pixels. Error: is none, or not within 640x400 to 7680x4320.
Result<std::pair<int, int>> window_size(const EditCommand& command);

// Opens the organ and edits it as the options say: first releases, then holds, regions, materials.
// What was repaired or filled goes to the log. Error: names the option or the file.
Result<edit::Editor> open(const EditCommand& command);

// Saves it as `out` says, else beside what was opened, and returns the file's name.
Result<std::string> save(const EditCommand& command, const edit::Editor& editor);

}  // namespace trocar::edit_command
