#pragma once

// The real programs as child processes, in a folder of their own.

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "common/base/tick.h"
#include "tests/support/child_program.h"

namespace trocar::e2e {

using testing::Program;

// A folder of this run for the current test, named after it.
std::filesystem::path test_folder();
std::string read_text(const std::filesystem::path& file);
// The value of `"key": value` in a JSON text: number, true/false or string without its quotes.
std::string json_value(const std::string& json, const std::string& key);
double json_number(const std::string& json, const std::string& key);
bool wait_for_file(const std::filesystem::path& file, double seconds);
// Asks every 20 ms, or less often if asking takes long; false if the answer is still no after
// `seconds`.
bool wait_until(const std::function<bool()>& condition, double seconds);

// A role's join code and link, as a server has printed them into its log.
struct Invitation {
  std::string code, link;
};
Invitation find_invitation(const std::filesystem::path& log, const std::string& role);
// "127.0.0.1:PORT" of a program that has written its ready file.
std::string ready_address(const std::filesystem::path& ready_file);

// The scripts that come with the programs.
inline const std::filesystem::path kScenes =
    std::filesystem::path(TROCAR_SOURCE_DIR) / "deploy/scenes";

// Options of a server whose hands are scripts: its time begins when so many people are there, and
// goes as fast as the hands follow. So a session does not depend on what else the machine does.
std::vector<std::string> at_pace(int people, std::vector<std::string> more = {});

// A server on a free port and clients of it, all logging into test_folder().
class Session {
 public:
  explicit Session(const std::string& organ, const std::vector<std::string>& extra = {});

  Program& server() { return server_; }
  const std::string& address() const { return address_; }
  // Extra arguments are appended; every client writes <name>.json at its end.
  Program client(const std::string& name, const std::string& role,
                 const std::vector<std::string>& extra = {});
  // A client that plays a script of deploy/scenes or of `folder`.
  Program hand(const std::string& name, const std::filesystem::path& script);
  // Until that tick is in the recording, which gets a chunk every 250 ms.
  bool wait_for_tick(Tick tick, double seconds = 120) const;
  std::string summary_of(const std::string& name) const {
    return read_text(folder / (name + ".json"));
  }

  std::filesystem::path folder = test_folder();
  std::filesystem::path journal = folder / "session.mcap";

 private:
  Program server_;
  std::string address_;
};

}  // namespace trocar::e2e
