#pragma once

// Optional test material outside the repository: environment variable TROCAR_SHARED, else the
// folder `shared` beside the source tree. A test that needs it and does not find it is skipped,
// loudly.

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

namespace trocar::testing {

inline std::filesystem::path shared_folder() {
  if (const char* set = std::getenv("TROCAR_SHARED")) return set;
  return std::filesystem::path(TROCAR_SOURCE_DIR).parent_path() / "shared";
}

}  // namespace trocar::testing

#define TROCAR_SKIP_WITHOUT_SHARED(relative_path)                                     \
  if (!std::filesystem::exists(::trocar::testing::shared_folder() / (relative_path))) \
  GTEST_SKIP() << "test material not found: "                                         \
               << ::trocar::testing::shared_folder() / (relative_path) << " (set TROCAR_SHARED)"
