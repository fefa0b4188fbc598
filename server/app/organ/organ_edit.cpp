#include "server/app/organ/organ_edit.h"

#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/own_folder.h"
#include "common/process/process.h"
#include "server/app/organ/organ_print.h"
#include "server/app/organ/program_name.h"

namespace trocar::app {
namespace {

constexpr const char* kWindowProgram = "trocar-organ-edit";

Status edit_without_window(const edit_command::EditCommand& command) {
  const auto editor = edit_command::open(command);
  if (!editor) return editor.error();
  const auto file = edit_command::save(command, *editor);
  if (!file) return file.error();
  print_text(editor->organ());
  std::printf("  file                %s\n", file->c_str());
  for (const auto& remark : editor->remarks())
    std::fprintf(stderr, "%s: warning: %s\n", kProgram, remark.c_str());
  return {};
}

bool has_display() {
  for (const char* name : {"DISPLAY", "WAYLAND_DISPLAY"}) {
    const char* value = std::getenv(name);
    if (value != nullptr && *value != 0) return true;
  }
  return false;
}

}  // namespace

Status run_edit(const edit_command::EditCommand& command, int argc, char** argv) {
  if (command.is_headless) return edit_without_window(command);
  if (const auto size = edit_command::window_size(command); !size) return size.error();
  if (!has_display())
    return Error{ErrorCode::ResourceMissing,
                 "edit: there is no display for a window: start it in a desktop session, or say "
                 "--headless with --hold, --release, --region, --give or --material"};
  const auto program = (own_folder() / kWindowProgram).string();
  if (::access(program.c_str(), X_OK) != 0)
    return Error{ErrorCode::ResourceMissing,
                 std::string("edit: the window's program ") + kWindowProgram +
                     " is not beside this one: install trocar-client, or build with "
                     "TROCAR_CLIENT=ON; --headless needs none"};
  std::vector<std::string> words{program};
  bool has_left_out_edit = false;
  for (int i = 1; i < argc; ++i) {
    if (!has_left_out_edit && std::string_view(argv[i]) == "edit")
      has_left_out_edit = true;
    else
      words.emplace_back(argv[i]);
  }
  const auto failed = process::become(words);
  return Error{failed.code, "edit: " + failed.message};
}

}  // namespace trocar::app
