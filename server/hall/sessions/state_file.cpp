#include "server/hall/sessions/state_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <utility>

#include "common/base/json.h"
#include "common/secure/private_files.h"

namespace trocar::hall {
namespace {

constexpr int kStateVersion = 1;
constexpr std::size_t kMostSavedSessions = 256;

Json to_json(const SavedSession& session) {
  Json json{{"name", session.name},
            {"start",
             {{"name", session.offer.name},
              {"lesson", session.offer.lesson},
              {"organ", session.offer.organ},
              {"workers", session.offer.workers},
              {"bleeding", session.offer.bleeds}}},
            {"folder", session.folder.string()},
            {"port", session.port},
            {"figures_port", session.figures_port},
            {"recordings", session.recordings},
            {"arguments", session.arguments},
            {"pid", session.process.pid},
            {"started_at", session.process.started_at},
            {"restarts", session.restarts},
            {"since_unix_s", session.since_unix_s},
            {"codes", session.codes},
            {"is_ending", session.is_ending},
            {"peak_cores", session.peak_cores},
            {"busy_windows", session.busy_windows}};
  if (session.offer.cores) json["start"]["cores"] = *session.offer.cores;
  return json;
}

// Throws what nlohmann::json and whole_number() throw.
SavedSession session_in(const Json& json) {
  SavedSession session;
  session.name = json.at("name").get<std::string>();
  const auto& offer = json.at("start");
  session.offer.name = offer.at("name").get<std::string>();
  session.offer.lesson = offer.at("lesson").get<std::string>();
  session.offer.organ = offer.at("organ").get<std::string>();
  session.offer.workers = whole_number<unsigned>(offer, "workers");
  session.offer.bleeds = offer.at("bleeding").get<bool>();
  if (offer.contains("cores")) session.offer.cores = offer.at("cores").get<double>();
  session.folder = json.at("folder").get<std::string>();
  session.port = whole_number<std::uint16_t>(json, "port");
  session.figures_port = whole_number<std::uint16_t>(json, "figures_port");
  session.recordings = json.at("recordings").get<std::vector<std::string>>();
  session.arguments = json.at("arguments").get<std::vector<std::string>>();
  session.process.pid = whole_number<pid_t>(json, "pid");
  session.process.started_at = whole_number<std::uint64_t>(json, "started_at");
  session.restarts = whole_number<int>(json, "restarts");
  session.since_unix_s = whole_number<std::int64_t>(json, "since_unix_s");
  session.codes = json.at("codes").get<std::map<std::string, std::string>>();
  session.is_ending = json.at("is_ending").get<bool>();
  session.peak_cores = json.at("peak_cores").get<double>();
  session.busy_windows = whole_number<int>(json, "busy_windows");
  if (!is_name(session.name)) throw std::out_of_range("name is no name");
  if (session.offer.cores.value_or(1) <= 0) throw std::out_of_range("cores is not above 0");
  return session;
}

}  // namespace

std::string to_text(const HallState& state) {
  Json json{{"version", kStateVersion}, {"sessions", Json::array()}};
  for (const auto& session : state.sessions) json["sessions"].push_back(to_json(session));
  json["measured_cores"] = state.measured_cores;
  return trocar::to_text(json);
}

Result<HallState> parse_state(std::string_view text, const std::string& source) {
  const auto damaged = [&source](const std::string& why) {
    return Error{ErrorCode::BadFile, source + ": is damaged (" + why +
                                         "): remove it; servers that run go on, and have to be "
                                         "ended one by one"};
  };
  HallState state;
  try {
    const auto json = Json::parse(text);
    if (whole_number<int>(json, "version") != kStateVersion)
      return damaged("it is of another version");
    const auto& sessions = json.at("sessions");
    if (!sessions.is_array() || sessions.size() > kMostSavedSessions)
      return damaged("it has no list of sessions");
    for (const auto& session : sessions) state.sessions.push_back(session_in(session));
    state.measured_cores = json.at("measured_cores").get<std::map<std::string, double>>();
  } catch (const Json::exception& error) {
    return damaged(error.what());
  } catch (const std::out_of_range& error) {
    return damaged(error.what());
  }
  return state;
}

Result<StateFile> StateFile::open(const std::filesystem::path& folder) {
  if (const auto made = secure::make_private_folder(folder); !made) return made.error();
  const auto lock_file = folder / "hall.lock";
  const int lock = ::open(lock_file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  StateFile file(folder / "sessions.json", lock);
  if (lock >= 0 && ::flock(lock, LOCK_EX | LOCK_NB) == 0) return file;
  return Error{ErrorCode::ResourceMissing,
               folder.string() +
                   ": another trocar-hall uses this folder of state: end it first, "
                   "or name another folder with the key state"};
}

Status StateFile::check(const std::filesystem::path& folder) {
  if (const auto fine = secure::check_private_folder(folder); !fine) return fine;
  const auto read = StateFile(folder / "sessions.json", -1).read();
  return read ? Status() : Status(read.error());
}

StateFile::StateFile(StateFile&& other) noexcept
    : file_(std::move(other.file_)), lock_(std::exchange(other.lock_, -1)) {}

StateFile::~StateFile() {
  if (lock_ >= 0) ::close(lock_);
}

Result<HallState> StateFile::read() const {
  std::error_code ignored;
  if (!std::filesystem::exists(file_, ignored)) return HallState{};
  const auto text = secure::read_private_file(file_);
  if (!text) return text.error();
  return parse_state(*text, file_.string());
}

Status StateFile::write(const HallState& state) const {
  return secure::write_private_file(file_, to_text(state));
}

}  // namespace trocar::hall
