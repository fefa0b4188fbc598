#pragma once

// The places of a session in a private file, with the tokens to come back to them, so that people
// can return to a server that was killed and goes on with its recording.
//
//   places-PORT.json   {"version": 1, "places": [{"slot", "name", "token", "code"}]}: `token` as
//                      hexadecimal digits, `code` the number of the join code; of mode 0600, and
//                      removed when the session ends

#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/session/participants/absences.h"

namespace trocar::app {

struct KeptPlace {
  ParticipantSlot slot;
  std::string name;
  participants::ReturnToken token{};
  std::uint32_t code = 0;

  bool operator==(const KeptPlace&) const = default;
};

std::filesystem::path places_file(const std::filesystem::path& state_folder, std::uint16_t port);
Status write_places(const std::filesystem::path& file, const std::vector<KeptPlace>& places);
// Nothing if there is no such file.
Result<std::vector<KeptPlace>> read_places(const std::filesystem::path& file);

}  // namespace trocar::app
