#include "common/base/program.h"

#include <csignal>
#include <cstdio>
#include <cstdlib>

#include "common/base/exit_code.h"

namespace trocar {

void begin_program(const char* program) {
  std::signal(SIGXFSZ, SIG_IGN);
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
      __builtin_cpu_supports("bmi2"))
    return;
  std::fprintf(stderr,
               "%s: this processor lacks AVX2, FMA or BMI2: use an x86-64-v3 machine "
               "(Intel Haswell, AMD Zen or newer)\n",
               program);
  std::exit(static_cast<int>(ExitCode::ResourceMissing));
}

}  // namespace trocar
