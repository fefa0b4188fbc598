#include "client/render/drawing_priority.h"

#include <sys/resource.h>
#include <unistd.h>

#include <charconv>
#include <filesystem>
#include <fstream>
#include <string>

#include "common/base/time_slice.h"

namespace trocar::render {
namespace {

// Beside work of ordinary priority on the same core, drawing gets a tenth of its time.
constexpr int kNiceness = 10;

bool draws(const std::filesystem::path& task) {
  std::ifstream file(task / "comm");
  std::string name;
  return std::getline(file, name) && name.starts_with("llvmpipe");
}

bool lower(id_t thread) {
  ask_for_short_slices(static_cast<pid_t>(thread));
  if (getpriority(PRIO_PROCESS, thread) >= kNiceness) return true;
  return setpriority(PRIO_PROCESS, thread, kNiceness) == 0;
}

}  // namespace

int yield_to_other_work() {
  int count = lower(static_cast<id_t>(gettid())) ? 1 : 0;
  std::error_code ended;  // a thread that is gone meanwhile needs nothing
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task", ended)) {
    const auto name = task.path().filename().string();
    id_t thread = 0;
    const auto read = std::from_chars(name.data(), name.data() + name.size(), thread);
    if (read.ec == std::errc() && draws(task.path()) && lower(thread)) ++count;
  }
  return count;
}

}  // namespace trocar::render
