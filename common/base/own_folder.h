#pragma once

#include <filesystem>

namespace trocar {

// The folder of the running program, in which the others lie, too. Empty without /proc.
inline std::filesystem::path own_folder() {
  std::error_code ignored;
  return std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path();
}

}  // namespace trocar
