#pragma once

// Files that only their owner may read: folders of mode 0700, files of mode 0600, written beside
// and renamed. Who reads such a file sees it whole or not at all.

#include <filesystem>

#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace trocar::secure {

// $XDG_STATE_HOME/trocar or ~/.local/state/trocar; an error if neither variable is set.
Result<std::filesystem::path> default_state_folder();
// A server leaves its link file in one of these, the best place first: $XDG_RUNTIME_DIR/trocar,
// then the default state folder.
std::vector<std::filesystem::path> link_folders();

// Makes it and what is missing above it; an error if it is another user's, or others may look into
// it.
Status make_private_folder(const std::filesystem::path& folder);
// Says whether make_private_folder() would succeed, without making anything.
Status check_private_folder(const std::filesystem::path& folder);
Status write_private_file(const std::filesystem::path& path, std::string_view text);
// An error if it is not there, larger than 1 MiB, or others may read it.
Result<std::string> read_private_file(const std::filesystem::path& path);
// The same without a look at who may read it.
Result<std::string> read_small_file(const std::filesystem::path& path);

// Holds a folder for one process at a time, for as long as it lives.
class FolderLock {
 public:
  explicit FolderLock(const std::filesystem::path& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int file_ = -1;
};

}  // namespace trocar::secure
