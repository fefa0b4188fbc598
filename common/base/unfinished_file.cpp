#include "common/base/unfinished_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>

namespace trocar {
namespace {

// A signal removes these. It leaves what is more than so many at a time, and longer names.
constexpr std::size_t kMostFiles = 8;
struct Slot {
  std::atomic<bool> is_taken{false}, is_set{false};
  std::array<char, PATH_MAX> path{};
};
std::array<Slot, kMostFiles> slots;
static_assert(std::atomic<bool>::is_always_lock_free, "signal handlers need it");

std::size_t take_slot(const std::string& path) {
  if (path.size() >= PATH_MAX) return kMostFiles;
  for (std::size_t i = 0; i < kMostFiles; ++i) {
    if (slots[i].is_taken.exchange(true)) continue;
    std::memcpy(slots[i].path.data(), path.c_str(), path.size() + 1);
    slots[i].is_set = true;
    return i;
  }
  return kMostFiles;
}

// Calls only what a signal handler may call.
void remove_and_end(int number) {
  for (const auto& slot : slots)
    if (slot.is_set) unlink(slot.path.data());
  std::signal(number, SIG_DFL);
  raise(number);
}

Error exists(const std::string& path) {
  return {ErrorCode::BadFile, path + ": exists already; choose another name or move it away"};
}

}  // namespace

Status UnfinishedFile::refuse_existing(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::exists(path, ignored)) return exists(path);
  return {};
}

std::string UnfinishedFile::name_for(const std::string& path) {
  return path + ".part-" + std::to_string(::getpid());
}

UnfinishedFile::UnfinishedFile(std::string path)
    : path_(std::move(path)), slot_(take_slot(path_)) {}

UnfinishedFile::~UnfinishedFile() {
  if (!path_.empty()) ::unlink(path_.c_str());
  forget();
}

Status UnfinishedFile::rename_to_new(const std::string& to) {
  int failed = 0;
  if (::renameat2(AT_FDCWD, path_.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) != 0)
    failed = errno;
  // A file system that cannot do that in one step takes two.
  if (failed == EINVAL || failed == ENOSYS) {
    if (auto is_free = refuse_existing(to); !is_free) return is_free;
    return rename_to(to);
  }
  if (failed == EEXIST) return exists(to);
  if (failed != 0) return Error{ErrorCode::ResourceMissing, to + ": " + std::strerror(failed)};
  forget();
  return {};
}

Status UnfinishedFile::rename_to(const std::string& to) {
  if (std::rename(path_.c_str(), to.c_str()) != 0)
    return Error{ErrorCode::ResourceMissing, to + ": " + std::strerror(errno)};
  forget();
  return {};
}

void UnfinishedFile::forget() {
  path_.clear();
  if (slot_ == kMostFiles) return;
  slots[slot_].is_set = false;
  slots[slot_].is_taken = false;
  slot_ = kMostFiles;
}

Status write_whole_file(const std::string& path, std::string_view content, unsigned mode) {
  UnfinishedFile part(UnfinishedFile::name_for(path));
  ::unlink(part.path().c_str());  // left by a program that was killed
  const int file = ::open(part.path().c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
  int failed = file < 0 ? errno : 0;
  while (failed == 0 && !content.empty()) {
    const auto written = ::write(file, content.data(), content.size());
    if (written > 0)
      content.remove_prefix(static_cast<std::size_t>(written));
    else if (errno != EINTR)
      failed = errno;
  }
  if (file >= 0 && ::close(file) != 0 && failed == 0) failed = errno;
  if (failed == 0) return part.rename_to(path);
  return Error{ErrorCode::ResourceMissing, path + ": cannot be written (" + std::strerror(failed) +
                                               "): check that its folder is there and has room"};
}

void remove_unfinished_files_on_signals() {
  for (const int number : {SIGTERM, SIGINT, SIGHUP})
    if (std::signal(number, remove_and_end) == SIG_IGN) std::signal(number, SIG_IGN);
}

}  // namespace trocar
