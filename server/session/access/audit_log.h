#pragma once

// The audit log: who came, left, was refused, and what instructors did, one JSON object per line,
// appended with one write each. A line that cannot be written is said once in the program's log. A
// file that has grown to its limit becomes FILE.1, in place of the one before, and a new one
// begins.

#include <filesystem>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace trocar::access {

struct AuditLine {
  std::string_view event;  // join, leave, refusal, mark, return, lost, back
  std::string_view name, role, address;
  std::string_view reason = {};  // of a refusal
  std::uint32_t code = 0;        // number in the code book; 0: none
  std::uint64_t left_out = 0;    // refusals since the last line that were too many to write
};

class AuditLog {
 public:
  static constexpr std::uint64_t kMostBytes = 10'000'000;

  // Opens or makes the file, with mode 0600.
  static Result<AuditLog> open(const std::filesystem::path& file,
                               std::uint64_t most_bytes = kMostBytes);
  AuditLog(AuditLog&& other) noexcept;
  AuditLog& operator=(AuditLog&&) = delete;
  ~AuditLog();

  void write(const AuditLine& line);

 private:
  AuditLog(std::filesystem::path path, int file, std::uint64_t most_bytes);
  void begin_anew();

  std::filesystem::path path_;
  int file_ = -1;
  std::uint64_t bytes_ = 0, most_bytes_ = 0;
  bool has_failed_ = false;
};

}  // namespace trocar::access
