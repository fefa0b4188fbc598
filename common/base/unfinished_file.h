#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace trocar {

// A file that gets its name when it is whole. Until then it has another name beside it, and is
// removed with this object, or by a signal after remove_unfinished_files_on_signals().
class UnfinishedFile {
 public:
  // Error (BadFile): there is a file of that name already.
  static Status refuse_existing(const std::string& path);
  // Returns the name until then, "PATH.part-PID".
  static std::string name_for(const std::string& path);

  // The file `path` was made by the caller.
  explicit UnfinishedFile(std::string path);
  ~UnfinishedFile();
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;

  const std::string& path() const { return path_; }
  // Errors: a file of that name is there meanwhile, and stays as it is; or it cannot be renamed.
  Status rename_to_new(const std::string& to);
  // The same, but takes the place of a file of that name.
  Status rename_to(const std::string& to);

 private:
  void forget();

  std::string path_;  // empty: it has its name
  std::size_t slot_;  // among those that a signal removes
};

// Writes a file of that name beside and renames it: whoever waits for it never sees half of it. It
// takes the place of a file, or of a link, of that name. `mode`: as open(2) has it.
Status write_whole_file(const std::string& path, std::string_view content, unsigned mode = 0666);

// From then on SIGTERM, SIGINT and SIGHUP remove what is unfinished, and end the program as they do
// anyway. Those that are ignored stay so. Call once, before there are threads.
void remove_unfinished_files_on_signals();

}  // namespace trocar
