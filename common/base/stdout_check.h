#pragma once

namespace trocar {

// Returns the exit code for main(). Says in one line on standard error that standard output could
// not be written, if it could not; a code of 0 becomes that of ErrorCode::ResourceMissing then.
int finish_output(const char* program, int code);

}  // namespace trocar
