#pragma once

namespace trocar {

// Prints one line and exits with ExitCode::ResourceMissing unless this processor has AVX2, FMA and
// BMI2 (x86-64-v3), which all our code is compiled for. Every main() calls it first.
void require_cpu_features(const char* program);

}  // namespace trocar
