#include "common/base/result.h"

#include <cstdio>

namespace trocar {

ExitCode exit_code_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::Usage:
      return ExitCode::Usage;
    case ErrorCode::BadFile:
    case ErrorCode::BadMessage:
      return ExitCode::BadFile;
    case ErrorCode::Refused:
      return ExitCode::Refused;
    case ErrorCode::ResourceMissing:
      return ExitCode::ResourceMissing;
    case ErrorCode::Mismatch:
      return ExitCode::Mismatch;
  }
  return ExitCode::Usage;
}

int report(const char* program, const Error& error) {
  std::fprintf(stderr, "%s: %s\n", program, error.message.c_str());
  return static_cast<int>(exit_code_of(error.code));
}

}  // namespace trocar
