#include "server/app/hall/hall_commands.h"

#include <fmt/format.h>

#include <cstdio>
#include <thread>

#include "common/base/json.h"
#include "common/base/printable.h"
#include "server/app/hall/hall_client.h"
#include "server/app/hall/hall_server.h"
#include "server/app/hall/hall_start.h"
#include "server/hall/plan/hall_config.h"

namespace trocar::app {
namespace {

constexpr std::chrono::seconds kAnswer{10};
constexpr std::chrono::milliseconds kStartPoll{300};
constexpr int kStartPolls = 600;  // 3 min: large organs need long

// The words of another program are shown as text alone.
std::string word(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? printable(found->get<std::string>(), 200) : "";
}

double number(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->get<double>() : 0;
}

void print(const std::string& text) {
  std::fputs(text.c_str(), stdout);
}

void print_codes(const Json& session) {
  const auto codes = session.find("codes");
  if (codes == session.end() || !codes->is_object()) return;
  for (const auto& [role, code] : codes->items())
    if (code.is_string())
      print(fmt::format("    {:<10}  {}  trocar://{}/{}\n", printable(role, 16),
                        printable(code.get<std::string>(), 32), word(session, "address"),
                        printable(code.get<std::string>(), 32)));
}

void print_session(const Json& session) {
  print(fmt::format("{:<20} {:<9} {:<14} {:>6.0f} {:>6.2f} {:>6.2f}  {:<20}  {}\n",
                    word(session, "name"), word(session, "state"), word(session, "organ"),
                    number(session, "people"), number(session, "time_rate"),
                    number(session, "cores"), word(session, "since"), word(session, "address")));
  if (const auto why = word(session, "failure"); !why.empty()) print("    " + why + "\n");
  print_codes(session);
}

Status list(const HallClient& client, bool is_json) {
  const auto answer = client.ask("GET", "/sessions", "", kAnswer);
  if (!answer) return answer.error();
  if (is_json) {
    print(to_text(*answer));
    return {};
  }
  const auto sessions = answer->value("sessions", Json::array());
  if (sessions.empty()) print("No session runs.\n");
  if (!sessions.empty())
    print(fmt::format("{:<20} {:<9} {:<14} {:>6} {:>6} {:>6}  {:<20}  {}\n", "session", "state",
                      "organ", "people", "time", "cores", "since", "address"));
  for (const auto& session : sessions)
    if (session.is_object()) print_session(session);
  print(fmt::format("{:.2f} of {:.2f} cores are taken.\n", number(*answer, "cores_taken"),
                    number(*answer, "cores")));
  return {};
}

Status start(const HallClient& client, const HallOptions& options) {
  Json request{{"start", options.what}};
  if (!options.name.empty()) request["name"] = options.name;
  auto session = client.ask("POST", "/sessions",
                            request.dump(-1, ' ', false, Json::error_handler_t::replace), kAnswer);
  if (!session) return session.error();
  const auto name = word(*session, "name");
  if (!hall::is_name(name))
    return Error{ErrorCode::BadMessage,
                 "the hall's answer names no session: is it of this version?"};
  for (int i = 0; i < kStartPolls && word(*session, "state") == "starting"; ++i) {
    std::this_thread::sleep_for(kStartPoll);
    session = client.ask("GET", "/sessions/" + name, "", kAnswer);
    if (!session) return session.error();
  }
  if (const auto why = word(*session, "failure"); !why.empty())
    return Error{ErrorCode::Refused, name + ": " + why};
  if (options.is_json) {
    print(to_text(*session));
    return {};
  }
  print(fmt::format("{}: {} at {}\n", name, word(*session, "state"), word(*session, "address")));
  print_codes(*session);
  return {};
}

Status end(const HallClient& client, const std::string& name) {
  if (!hall::is_name(name))
    return Error{ErrorCode::Usage, printable(name, 64) + ": is no name of a session, see list"};
  const auto session =
      client.ask("DELETE", "/sessions/" + name, "", HallServer::kEndDeadline + kAnswer);
  if (!session) return session.error();
  print(fmt::format("{}: {}, recorded in {}\n", name, word(*session, "state"),
                    word(*session, "recording")));
  return {};
}

}  // namespace

Status run_hall_command(const HallOptions& options) {
  std::string key;
  if (!options.key_file.empty()) {
    auto read = read_key(options.key_file);
    if (!read) return Error{read.error().code, "--key: " + read.error().message};
    key = std::move(*read);
  }
  const HallClient client(options.host, options.port, key);
  switch (options.command) {
    case HallCommand::List:
      return list(client, options.is_json);
    case HallCommand::Start:
      return start(client, options);
    case HallCommand::End:
      return end(client, options.what);
    case HallCommand::Serve:
      break;
  }
  return {};
}

}  // namespace trocar::app
