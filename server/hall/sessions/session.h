#pragma once

// A session of a hall: what is kept of it in the state file, and what is known while it runs.

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/base/json.h"
#include "server/hall/plan/figures_text.h"
#include "server/hall/plan/hall_config.h"
#include "server/hall/processes/server_process.h"

namespace trocar::hall {

enum class SessionState : std::uint8_t {
  Starting,  // the server reads its organ, or its recording after a crash
  Running,
  Ending,  // it was told to end, and closes its recording
  Ended,
  Failed,  // it has ended otherwise, and is not started again
};
const char* name_of(SessionState state);

// A later hall needs this to find a session again, or to start it from its recording.
struct SavedSession {
  std::string name;
  Offer offer;
  std::filesystem::path folder;  // of its recordings
  std::uint16_t port = 0, figures_port = 0;
  std::vector<std::string> recordings;  // names of files in `folder`, the newest last
  std::vector<std::string> arguments;   // of the process
  ProcessId process;                    // pid 0: none
  int restarts = 0;
  std::int64_t since_unix_s = 0;
  std::map<std::string, std::string> codes;  // join codes by role
  bool is_ending = false;
  double peak_cores = 0;  // 0: not measured yet
  int busy_windows = 0;   // over which processor time was measured while tools acted
};

struct Session : SavedSession {
  SessionState state = SessionState::Starting;
  std::string failure;  // one line, if it has failed
  std::optional<ServerProcess> server;
  ServerFigures figures;
  bool is_probed = false;  // its figures are being asked for
  double probe_at_s = 0, restart_at_s = 0, kill_at_s = 0, running_since_s = 0;
  double answered_at_s = 0;  // its figures are of then
  // The window over which processor time is measured; begins at 0: there is none.
  double window_from_s = 0, window_processor_s = 0;
  bool has_acted = false;  // a tool, in this window
  double cores = 0;        // in the last window
};

// Returns for how many seconds a running session has not answered; 0 for one in another state.
double silence_s(const Session& session);

// Files in the session's folder.
std::filesystem::path log_of(const SavedSession& session);
// The server writes it when it has ended in order, its recording closed.
std::filesystem::path summary_of(const SavedSession& session);
std::filesystem::path newest_recording(const SavedSession& session);

// "192.168.1.20:7710".
std::string address_of(const SavedSession& session, const HallConfig& config);
// The options that trocar-server is called with. The newest of session.recordings is written; the
// one before is gone on with, if there is one.
std::vector<std::string> server_arguments(const SavedSession& session, const HallConfig& config);
// `is_trusted`: with join codes and paths.
Json describe(const Session& session, const HallConfig& config, bool is_trusted);

}  // namespace trocar::hall
