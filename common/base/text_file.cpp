#include "common/base/text_file.h"

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace trocar {

Status write_text_file(const std::filesystem::path& path, std::string_view text) {
  const std::string part = path.string() + ".part";
  std::FILE* file = std::fopen(part.c_str(), "wb");
  bool is_good = file != nullptr;
  if (is_good) {
    is_good = std::fwrite(text.data(), 1, text.size(), file) == text.size();
    is_good = std::fclose(file) == 0 && is_good;
    is_good = is_good && std::rename(part.c_str(), path.c_str()) == 0;
  }
  if (is_good) return {};
  return Error{ErrorCode::ResourceMissing, path.string() + ": cannot be written (" +
                                               std::strerror(errno) +
                                               "): check that the folder exists and has room"};
}

}  // namespace trocar
