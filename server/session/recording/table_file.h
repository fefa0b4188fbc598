#pragma once

// A table (CSV) that is written row by row and gets its name when it is whole. A file of that name
// is replaced. A device, a pipe and what a link leads to take the rows at once.

#include <cstdio>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/base/unfinished_file.h"

namespace trocar::recording {

class TableFile {
 public:
  // option: what named the table, such as "--forces", for messages.
  TableFile(std::string option, std::string path);
  ~TableFile();  // removes what was not finished
  TableFile(const TableFile&) = delete;
  TableFile& operator=(const TableFile&) = delete;

  // False: it cannot be written, and finish() says why.
  bool write(std::string_view rows);
  // Call once. Error: the folder is missing, the disk is full, ...
  Status finish();

 private:
  void fail();

  std::string option_, path_;
  std::FILE* file_ = nullptr;
  std::optional<UnfinishedFile> part_;  // nothing: it takes them at once
  std::string failure_;                 // empty: none
};

}  // namespace trocar::recording
