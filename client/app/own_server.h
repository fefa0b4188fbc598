#pragma once

// A server that this client has started, for practice or for a lesson that it hosts. It ends with
// the client, however that ends.

#include <filesystem>
#include <memory>
#include <string>

#include "common/base/result.h"
#include "common/process/process.h"

namespace trocar::app {

class OwnServer {
 public:
  struct Settings {
    std::string organ = "liver";
    std::string lesson;               // brings its organ; empty: none
    bool is_for_network = false;      // otherwise for this machine alone
    std::filesystem::path recording;  // empty: none
  };
  static constexpr std::uint16_t kPort = 7690;

  // Starts the trocar-server beside this program, or the one on the path. What it says goes to
  // `log`, a new file.
  static Result<std::unique_ptr<OwnServer>> start(const Settings& settings,
                                                  const std::filesystem::path& log);
  // Asks it to end, which closes its session and its recording, and waits for that.
  ~OwnServer();
  OwnServer(const OwnServer&) = delete;
  OwnServer& operator=(const OwnServer&) = delete;

  const Settings& settings() const { return settings_; }
  // False: it has ended, and last_words() says why.
  bool is_running() { return !child_.poll(); }
  std::string last_words() const;

 private:
  OwnServer(process::Child child, Settings settings, std::filesystem::path log)
      : child_(std::move(child)), settings_(std::move(settings)), log_(std::move(log)) {}

  process::Child child_;
  Settings settings_;
  std::filesystem::path log_;
};

}  // namespace trocar::app
