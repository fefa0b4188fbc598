#include "common/base/stdout_check.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>

#include "common/base/result.h"

namespace trocar {

int finish_output(const char* program, int code) {
  const int failed = std::fflush(stdout) == 0 ? 0 : errno;
  if (failed == 0 && std::ferror(stdout) == 0) return code;
  // The reason of a failure before the last write is not known any more.
  const std::string why =
      failed == 0 ? std::string() : " (" + std::string(std::strerror(failed)) + ")";
  const int missing =
      report(program, {ErrorCode::ResourceMissing, "standard output cannot be written" + why +
                                                       ": what was printed is not complete"});
  return code == 0 ? missing : code;
}

}  // namespace trocar
