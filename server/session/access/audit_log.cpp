#include "server/session/access/audit_log.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <ctime>
#include <limits>
#include <utility>

#include "common/base/json.h"
#include "common/base/log.h"

namespace trocar::access {
namespace {

std::string utc_now() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  ::gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

int open_to_append(const std::filesystem::path& path) {
  return ::open(path.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
}

}  // namespace

Result<AuditLog> AuditLog::open(const std::filesystem::path& path, std::uint64_t most_bytes) {
  const int file = open_to_append(path);
  if (file < 0)
    return Error{ErrorCode::ResourceMissing, "--audit: " + path.string() + ": cannot be written (" +
                                                 std::strerror(errno) +
                                                 "): check that the folder exists"};
  return AuditLog(path, file, most_bytes);
}

AuditLog::AuditLog(std::filesystem::path path, int file, std::uint64_t most_bytes)
    : path_(std::move(path)), file_(file), most_bytes_(most_bytes) {
  struct stat about {};
  const bool is_file = ::fstat(file_, &about) == 0 && S_ISREG(about.st_mode);
  if (is_file)
    bytes_ = static_cast<std::uint64_t>(about.st_size);
  else
    most_bytes_ = std::numeric_limits<std::uint64_t>::max();  // a device or pipe keeps nothing
}

AuditLog::AuditLog(AuditLog&& other) noexcept
    : path_(std::move(other.path_)),
      file_(std::exchange(other.file_, -1)),
      bytes_(other.bytes_),
      most_bytes_(other.most_bytes_),
      has_failed_(other.has_failed_) {}

// If that fails the file goes on growing: a long log is better than none.
void AuditLog::begin_anew() {
  std::error_code failed;
  std::filesystem::rename(path_, path_.string() + ".1", failed);
  bytes_ = 0;
  const int file = failed ? -1 : open_to_append(path_);
  if (file < 0) return;
  ::close(file_);
  file_ = file;
}

AuditLog::~AuditLog() {
  if (file_ >= 0) ::close(file_);
}

void AuditLog::write(const AuditLine& line) {
  Json json = {{"time", utc_now()},
               {"event", line.event},
               {"name", line.name},
               {"role", line.role},
               {"address", line.address}};
  if (line.code != 0) json["code"] = line.code;
  if (!line.reason.empty()) json["reason"] = line.reason;
  if (line.left_out != 0) json["left_out"] = line.left_out;
  // Bytes that are no UTF-8 are replaced, and only ASCII is written: no line can be forged.
  const auto text = json.dump(-1, ' ', true, Json::error_handler_t::replace) + "\n";
  if (bytes_ > 0 && bytes_ + text.size() > most_bytes_) begin_anew();
  bytes_ += text.size();
  if (::write(file_, text.data(), text.size()) == static_cast<ssize_t>(text.size())) return;
  if (!has_failed_)
    log::error("{}: cannot be written ({}): the audit log has a gap", path_.string(),
               std::strerror(errno));
  has_failed_ = true;
}

}  // namespace trocar::access
