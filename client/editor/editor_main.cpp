// trocar-organ-edit: the window of trocar-organ edit, which starts it.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <optional>
#include <string>

#include "client/editor/editor_window.h"
#include "common/base/log.h"
#include "common/base/program.h"
#include "common/base/timing.h"
#include "common/base/version.h"
#include "common/command_line/command_line.h"
#include "server/app/edit_command/edit_command.h"
#include "server/organs/edit/save.h"
#include "server/organs/material/material_file.h"

namespace trocar::editor {
namespace {

constexpr const char* kProgram = "trocar-organ-edit";
constexpr std::uint64_t kPictureNs = 16'666'667;

volatile std::sig_atomic_t stop_requested = 0;

void sleep_until(std::uint64_t ns) {
  const auto now = monotonic_ns();
  if (now >= ns) return;
  const timespec rest{0, static_cast<long>(ns - now)};
  ::nanosleep(&rest, nullptr);
}

Status show(const edit_command::EditCommand& command, edit::Editor& editor) {
  const auto size = edit_command::window_size(command);
  if (!size) return size.error();
  WindowSettings settings{
      .size = {size->first, size->second},
      .scale = command.scale,
      .file = command.out.empty() ? edit::free_name(command.organ).string() : command.out};
  const auto measured = material::measured_materials();
  settings.materials.assign(measured.begin(), measured.end());
  auto window = EditorWindow::open(editor, settings);
  if (!window) return window.error();
  auto last = monotonic_ns();
  while (!(*window)->is_over() && stop_requested == 0) {
    const auto now = monotonic_ns();
    (*window)->draw(std::min(static_cast<float>(now - last) * 1e-9f, 0.2f));
    last = now;
    sleep_until(now + kPictureNs);
  }
  return {};
}

int run(int argc, char** argv) {
  edit_command::EditCommand command;
  std::string log_level = "info";
  CLI::App app("Shows an organ and lets somebody edit it, for trocar-organ edit.", kProgram);
  app.set_version_flag("--version", std::string(kProgram) + " " + kVersion);
  app.add_option("--log-level", log_level, "error, warn, info, debug or off")
      ->capture_default_str();
  edit_command::add_options(app, command);
  const auto parsed = command_line::parse_command_line(app, argc, argv);
  if (!parsed) return report("trocar-organ", parsed.error());
  if (!*parsed) return static_cast<int>(ExitCode::Ok);
  if (const auto set = log::configure("trocar-organ", log_level); !set)
    return report("trocar-organ", set.error());
  const auto stop = [](int) { stop_requested = 1; };
  std::signal(SIGINT, stop);
  std::signal(SIGTERM, stop);
  auto editor = edit_command::open(command);
  if (!editor) return report("trocar-organ", editor.error());
  if (const auto shown = show(command, *editor); !shown)
    return report("trocar-organ", shown.error());
  return static_cast<int>(ExitCode::Ok);
}

}  // namespace
}  // namespace trocar::editor

int main(int argc, char** argv) {
  trocar::begin_program("trocar-organ");
  return trocar::editor::run(argc, argv);
}
