#include "server/session/recording/table_file.h"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

namespace trocar::recording {

TableFile::TableFile(std::string option, std::string path)
    : option_(std::move(option)), path_(std::move(path)) {
  std::error_code ignored;
  // A link such as /dev/stdout stays what it is.
  const auto kind = std::filesystem::symlink_status(path_, ignored).type();
  const bool is_direct =
      kind != std::filesystem::file_type::not_found && kind != std::filesystem::file_type::regular;
  const auto name = is_direct ? path_ : UnfinishedFile::name_for(path_);
  errno = 0;
  file_ = std::fopen(name.c_str(), "wb");
  if (file_ == nullptr)
    fail();
  else if (!is_direct)
    part_.emplace(name);
}

TableFile::~TableFile() {
  if (file_ != nullptr) std::fclose(file_);
}

void TableFile::fail() {
  if (failure_.empty()) failure_ = std::strerror(errno);
}

bool TableFile::write(std::string_view rows) {
  if (!failure_.empty()) return false;
  if (std::fwrite(rows.data(), 1, rows.size(), file_) != rows.size()) fail();
  return failure_.empty();
}

Status TableFile::finish() {
  if (file_ != nullptr && std::fclose(std::exchange(file_, nullptr)) != 0) fail();
  if (!failure_.empty())
    return Error{ErrorCode::ResourceMissing, option_ + ": " + path_ + ": cannot be written (" +
                                                 failure_ +
                                                 "): check that its folder is there and has room"};
  return part_ ? part_->rename_to(path_) : Status();
}

}  // namespace trocar::recording
