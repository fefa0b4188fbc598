#include "common/base/text_file.h"

#include <cerrno>
#include <cstring>
#include <fstream>

#include "common/base/unfinished_file.h"

namespace trocar {

Status write_text_file(const std::filesystem::path& path, std::string_view text) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  const auto kind = fs::symlink_status(path, ignored).type();
  if (kind == fs::file_type::not_found || kind == fs::file_type::regular)
    return write_whole_file(path.string(), text);
  // A device, or a link such as /dev/stdout, stays what it is.
  std::ofstream file(path, std::ios::binary);
  file.write(text.data(), static_cast<std::streamsize>(text.size()));
  file.close();
  if (file) return {};
  return Error{ErrorCode::ResourceMissing,
               path.string() + ": cannot be written (" + std::strerror(errno) + ")"};
}

}  // namespace trocar
