#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace trocar::process {

// A file without a name, for what a child reads or says. Where there is no memory for it, a child
// that is to have it cannot be started.
class MemoryFile {
 public:
  // It is read from its beginning.
  explicit MemoryFile(std::string_view text = {});
  MemoryFile(MemoryFile&& other) noexcept;
  MemoryFile& operator=(MemoryFile&&) = delete;
  ~MemoryFile();

  int descriptor() const { return descriptor_; }
  // Returns what stands in it, and no more than so many bytes.
  std::string text(std::size_t most_bytes) const;

 private:
  int descriptor_;
};

}  // namespace trocar::process
