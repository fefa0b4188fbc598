#include "server/hall/sessions/session.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>

#include "common/base/timing.h"

namespace trocar::hall {
namespace {

std::string host_of(const HallConfig& config) {
  if (!config.host.empty()) return config.host;
  const auto& address = config.sessions_address;
  if (address == "0.0.0.0" || address == "::") {
    std::array<char, 256> name{};
    if (::gethostname(name.data(), name.size() - 1) == 0) return name.data();
  }
  return address;
}

std::string place(const std::string& host, std::uint16_t port) {
  const bool is_ipv6 = host.find(':') != std::string::npos && !host.starts_with('[');
  return is_ipv6 ? fmt::format("[{}]:{}", host, port) : fmt::format("{}:{}", host, port);
}

std::filesystem::path server_state(const HallConfig& config) {
  return config.state_folder / "server";
}

}  // namespace

const char* name_of(SessionState state) {
  switch (state) {
    case SessionState::Starting:
      return "starting";
    case SessionState::Running:
      return "running";
    case SessionState::Ending:
      return "ending";
    case SessionState::Ended:
      return "ended";
    case SessionState::Failed:
      return "failed";
  }
  return "unknown";
}

double silence_s(const Session& session) {
  if (session.state != SessionState::Running) return 0;
  return std::max(0.0, static_cast<double>(monotonic_ns()) * 1e-9 - session.answered_at_s);
}

std::filesystem::path log_of(const SavedSession& session) {
  return session.folder / "server.log";
}

std::filesystem::path summary_of(const SavedSession& session) {
  return session.folder / "summary.json";
}

std::filesystem::path newest_recording(const SavedSession& session) {
  return session.recordings.empty() ? session.folder : session.folder / session.recordings.back();
}

std::string address_of(const SavedSession& session, const HallConfig& config) {
  return place(host_of(config), session.port);
}

std::vector<std::string> server_arguments(const SavedSession& session, const HallConfig& config) {
  std::vector<std::string> arguments{"--listen",     place(config.sessions_address, session.port),
                                     "--metrics",    place("127.0.0.1", session.figures_port),
                                     "--journal",    newest_recording(session).string(),
                                     "--summary",    summary_of(session).string(),
                                     "--audit",      (session.folder / "audit.jsonl").string(),
                                     "--state",      server_state(config).string(),
                                     "--announce",   session.name,
                                     "--code-hours", fmt::format("{}", config.code_hours),
                                     "--workers",    std::to_string(session.offer.workers),
                                     "--log-format", config.log_format};
  const auto add = [&arguments](const char* option, const std::string& value) {
    arguments.insert(arguments.end(), {option, value});
  };
  // A lesson that had not begun is in no recording.
  if (!session.offer.lesson.empty()) add("--lesson", session.offer.lesson);
  const auto count = session.recordings.size();
  if (count > 1) {
    add("--resume", (session.folder / session.recordings[count - 2]).string());
    return arguments;
  }
  if (session.offer.lesson.empty()) add("--organ", session.offer.organ);
  if (session.offer.bleeds) arguments.push_back("--bleeding");
  return arguments;
}

Json describe(const Session& session, const HallConfig& config, bool is_trusted) {
  Json json{{"name", session.name}, {"state", name_of(session.state)}};
  json["start"] = session.offer.name;
  if (!session.offer.lesson.empty()) json["lesson"] = session.offer.lesson;
  json["organ"] = session.offer.organ;
  json["address"] = address_of(session, config);
  json["since"] = fmt::format("{:%FT%TZ}", fmt::gmtime(session.since_unix_s));
  json["people"] = session.figures.people;
  json["time_rate"] = session.figures.time_rate;
  json["ticks"] = session.figures.ticks;
  json["tick_median_s"] = session.figures.tick_median_s;
  json["tick_p99_s"] = session.figures.tick_p99_s;
  json["slowest_stage_s"] = session.figures.slowest_stage_s;
  json["silence_s"] = silence_s(session);
  json["cores"] = session.cores;
  json["peak_cores"] = session.peak_cores;
  json["restarts"] = session.restarts;
  if (!session.failure.empty()) json["failure"] = session.failure;
  if (!is_trusted) return json;
  json["recording"] = newest_recording(session).string();
  json["codes"] = session.codes;
  return json;
}

}  // namespace trocar::hall
