#pragma once

// The audit log: who came, left, was refused, and what instructors did, one JSON object per line,
// appended with one write each. A line that cannot be written is said once in the program's log.

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
  // Opens or makes the file, with mode 0600.
  static Result<AuditLog> open(const std::filesystem::path& file);
  AuditLog(AuditLog&& other) noexcept;
  AuditLog& operator=(AuditLog&&) = delete;
  ~AuditLog();

  void write(const AuditLine& line);

 private:
  AuditLog(std::filesystem::path path, int file) : path_(std::move(path)), file_(file) {}

  std::filesystem::path path_;
  int file_ = -1;
  bool has_failed_ = false;
};

}  // namespace trocar::access
