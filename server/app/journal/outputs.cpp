#include "server/app/journal/outputs.h"

#include <filesystem>

#include "common/base/kept_file.h"

namespace trocar::app {
namespace {

namespace fs = std::filesystem;

// Devices and pipes may take several.
bool is_same_file(const fs::path& a, const fs::path& b) {
  std::error_code failed;
  if (fs::exists(a, failed) && !fs::is_regular_file(a, failed)) return false;
  if (fs::equivalent(a, b, failed)) return true;
  const auto whole_a = fs::weakly_canonical(a, failed), whole_b = fs::weakly_canonical(b, failed);
  return a == b || (!whole_a.empty() && whole_a == whole_b);
}

}  // namespace

Status check_outputs(const std::vector<Output>& outputs) {
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const auto& [option, path] = outputs[i];
    if (path.empty()) continue;
    if (auto kept = refuse_to_replace_kept(option, path); !kept) return kept;
    for (std::size_t j = 0; j < i; ++j)
      if (!outputs[j].path.empty() && is_same_file(outputs[j].path, path))
        return Error{ErrorCode::Usage, outputs[j].option + " and " + option + ": " + path +
                                           " cannot hold both: choose two names"};
  }
  return {};
}

}  // namespace trocar::app
