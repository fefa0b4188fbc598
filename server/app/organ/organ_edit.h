#pragma once

// trocar-organ edit: edits without a window, or becomes the program that has one.

#include "server/app/edit_command/edit_command.h"

namespace trocar::app {

// argc, argv: of this program, which the window's program reads again. Does not return where that
// program starts. Error: it is not there, or there is no display.
Status run_edit(const edit_command::EditCommand& command, int argc, char** argv);

}  // namespace trocar::app
