#pragma once

namespace trocar {

// Exit codes of every program.
enum class ExitCode : int {
  Ok = 0,               // also after SIGTERM
  Mismatch = 1,         // a check ran and found a difference
  Usage = 2,            // command line
  BadFile = 3,          // a file that cannot be used
  Refused = 4,          // the server said no
  ResourceMissing = 5,  // port taken, no display, processor too old...
  NotVerified = 6,      // a check could not be made, or not in full; no difference was found
};

}  // namespace trocar
