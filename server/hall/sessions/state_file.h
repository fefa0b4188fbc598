#pragma once

// The state file outlives a hall: its sessions, and what sessions of each kind have taken. It is a
// private file, written beside and renamed, so that a hall that is killed while it writes leaves
// the one before.

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "server/hall/sessions/session.h"

namespace trocar::hall {

struct HallState {
  std::vector<SavedSession> sessions;
  std::map<std::string, double> measured_cores;  // by the offer's name
};

std::string to_text(const HallState& state);
// `source` begins the line of an error.
Result<HallState> parse_state(std::string_view text, const std::string& source);

class StateFile {
 public:
  // Takes the folder for this hall alone and makes it if it is missing. Error: another hall has it.
  static Result<StateFile> open(const std::filesystem::path& folder);
  // Says whether open() and read() would succeed while no hall has the folder, without making
  // anything.
  static Status check(const std::filesystem::path& folder);
  StateFile(StateFile&& other) noexcept;
  StateFile& operator=(StateFile&&) = delete;
  ~StateFile();

  // A folder without the file has no sessions.
  Result<HallState> read() const;
  Status write(const HallState& state) const;

 private:
  StateFile(std::filesystem::path file, int lock) : file_(std::move(file)), lock_(lock) {}

  std::filesystem::path file_;
  int lock_ = -1;
};

}  // namespace trocar::hall
