#include "common/process/memory_file.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

namespace trocar::process {
namespace {

constexpr int kNoFile = -2;  // no child can have it
constexpr std::size_t kStepBytes = 64 * 1024;

}  // namespace

MemoryFile::MemoryFile(std::string_view text) : descriptor_(::memfd_create("text", MFD_CLOEXEC)) {
  bool is_good = descriptor_ >= 0;
  while (is_good && !text.empty()) {
    const auto written = ::write(descriptor_, text.data(), text.size());
    if (written > 0) text.remove_prefix(static_cast<std::size_t>(written));
    is_good = written > 0 || errno == EINTR;
  }
  if (is_good && ::lseek(descriptor_, 0, SEEK_SET) == 0) return;
  if (descriptor_ >= 0) ::close(descriptor_);
  descriptor_ = kNoFile;
}

MemoryFile::MemoryFile(MemoryFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, kNoFile)) {}

MemoryFile::~MemoryFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::string MemoryFile::text(std::size_t most_bytes) const {
  std::string text;
  for (ssize_t got = 1; got > 0 && text.size() < most_bytes;) {
    const auto before = text.size();
    text.resize(std::min(most_bytes, before + kStepBytes));
    got = ::pread(descriptor_, text.data() + before, text.size() - before,
                  static_cast<off_t>(before));
    text.resize(before + static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
  }
  return text;
}

}  // namespace trocar::process
