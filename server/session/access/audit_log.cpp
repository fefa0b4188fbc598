#include "server/session/access/audit_log.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <ctime>
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

}  // namespace

Result<AuditLog> AuditLog::open(const std::filesystem::path& path) {
  const int file = ::open(path.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
  if (file < 0)
    return Error{ErrorCode::ResourceMissing, "--audit: " + path.string() + ": cannot be written (" +
                                                 std::strerror(errno) +
                                                 "): check that the folder exists"};
  return AuditLog(path, file);
}

AuditLog::AuditLog(AuditLog&& other) noexcept
    : path_(std::move(other.path_)), file_(std::exchange(other.file_, -1)) {}

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
  if (::write(file_, text.data(), text.size()) == static_cast<ssize_t>(text.size())) return;
  if (!has_failed_)
    log::error("{}: cannot be written ({}): the audit log has a gap", path_.string(),
               std::strerror(errno));
  has_failed_ = true;
}

}  // namespace trocar::access
