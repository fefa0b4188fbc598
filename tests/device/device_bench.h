#pragma once

// Things that the tests of devices share.

#include <chrono>
#include <filesystem>
#include <string>
#include <thread>

#include "client/device/haptic_device.h"

namespace trocar::testing {

// Polls until it is true; false after a time so long that only a fault explains it.
template <typename Predicate>
bool eventually(Predicate&& is_true) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!is_true()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

// A folder for the sockets and files of one test; its name is short, as paths of sockets must be.
class ShortFolder {
 public:
  ShortFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "trocar-XXXXXX").string();
    path_ = mkdtemp(name.data());
  }
  ~ShortFolder() { std::filesystem::remove_all(path_); }
  ShortFolder(const ShortFolder&) = delete;
  ShortFolder& operator=(const ShortFolder&) = delete;

  std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

// An error is one line that says what to do.
inline bool is_advice(const Error& error) {
  return error.message.find(", ") != std::string::npos &&
         error.message.find('\n') == std::string::npos;
}

}  // namespace trocar::testing
