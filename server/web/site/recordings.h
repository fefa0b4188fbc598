#pragma once

// The recordings of one folder. Only regular files in it count, by names of letters, digits and
// ._- that end in .mcap: no name leads out of the folder, and no symbolic link is followed.

#include <sys/stat.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace trocar::site {

inline constexpr std::size_t kMostListed = 200;

bool is_recording_name(std::string_view name);

// A recording that is open, for as long as somebody reads it. It may grow meanwhile.
class OpenRecording {
 public:
  OpenRecording(int file, std::uint64_t size, std::int64_t changed_ns)
      : file_(file), size_(size), changed_ns_(changed_ns) {}
  ~OpenRecording();
  OpenRecording(const OpenRecording&) = delete;
  OpenRecording& operator=(const OpenRecording&) = delete;

  std::uint64_t size() const { return size_; }             // bytes, when it was opened
  std::int64_t changed_ns() const { return changed_ns_; }  // since 1970, when it was opened
  int file() const { return file_; }  // its descriptor, for as long as this lives
  // Reads at most `bytes` from `offset`; shorter at the end, empty if the file cannot be read.
  std::string read(std::uint64_t offset, std::size_t bytes) const;

 private:
  int file_;
  std::uint64_t size_;
  std::int64_t changed_ns_;
};

class Recordings {
 public:
  // An error if the folder is none, or may not be read.
  static Result<Recordings> open(const std::filesystem::path& folder);
  Recordings(Recordings&& other) noexcept;
  Recordings& operator=(Recordings&& other) noexcept;
  ~Recordings();

  // Files that end in .mcap and are not shown because of their names, sorted.
  std::vector<std::string> left_out() const;
  // A JSON array of name, bytes and time of last change (seconds since 1970): the newest first, at
  // most kMostListed.
  std::string list() const;
  // Null: there is no such recording.
  std::unique_ptr<OpenRecording> find(std::string_view name) const;

 private:
  void for_each_file(const std::function<void(const char*, const struct stat&)>& visit) const;
  Recordings(int folder, std::filesystem::path path) : folder_(folder), path_(std::move(path)) {}

  int folder_ = -1;
  std::filesystem::path path_;
};

}  // namespace trocar::site
