#pragma once

namespace trocar {

// Every main() calls this first. It prints one line and exits with ExitCode::ResourceMissing unless
// this processor has AVX2, FMA and BMI2 (x86-64-v3), which all our code is compiled for. From then
// on a file that reaches a limit of file sizes (ulimit -f) is an error of that write, as a full
// disk is, and not the end of the program (SIGXFSZ). Programs that this one starts inherit it.
void begin_program(const char* program);

}  // namespace trocar
