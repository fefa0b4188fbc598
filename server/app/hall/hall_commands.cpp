#include "server/app/hall/hall_commands.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <thread>

#include "common/base/json.h"
#include "common/base/printable.h"
#include "common/secure/certificate.h"
#include "common/secure/loopback.h"
#include "common/secure/private_files.h"
#include "server/app/hall/hall_bus.h"
#include "server/app/hall/hall_client.h"
#include "server/app/hall/hall_server.h"
#include "server/app/hall/hall_start.h"
#include "server/bus/bus.h"
#include "server/hall/plan/hall_config.h"

namespace trocar::app {
namespace {

constexpr std::chrono::seconds kAnswer{10};
constexpr std::chrono::milliseconds kBusWait{700};     // for all halls to answer
constexpr std::chrono::milliseconds kFirstWait{2000};  // for the first one
constexpr std::chrono::seconds kKeyAnswer{2};
constexpr double kLongSilence_s = 5;
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
  if (const double silence_s = number(session, "silence_s"); silence_s >= kLongSilence_s)
    print(fmt::format("    does not answer for {:.0f} s, its figures are of then\n", silence_s));
  print_codes(session);
}

// Prints the sessions of one hall, as GET /sessions has them.
void print_directory(const Json& hall) {
  const auto sessions = hall.value("sessions", Json::array());
  if (sessions.empty()) print("No session runs.\n");
  if (!sessions.empty())
    print(fmt::format("{:<20} {:<9} {:<14} {:>6} {:>6} {:>6}  {:<20}  {}\n", "session", "state",
                      "organ", "people", "time", "cores", "since", "address"));
  for (const auto& session : sessions)
    if (session.is_object()) print_session(session);
  print(fmt::format("{:.2f} of {:.2f} cores are taken.\n", number(hall, "cores_taken"),
                    number(hall, "cores")));
}

Status list(const HallConnection& client, bool is_json) {
  const auto answer = client.ask("GET", "/sessions", "", kAnswer);
  if (!answer) return answer.error();
  if (is_json)
    print(to_text(*answer));
  else
    print_directory(*answer);
  return {};
}

Result<Json> ask_to_start(const HallConnection& client, const HallOptions& options) {
  Json request{{"start", options.what}};
  if (!options.name.empty()) request["name"] = options.name;
  return client.ask("POST", "/sessions",
                    request.dump(-1, ' ', false, Json::error_handler_t::replace), kAnswer);
}

// Waits until a session that a hall has taken runs, and shows it.
Status await_start(const HallConnection& client, const HallOptions& options, Result<Json> session) {
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

Status start(const HallConnection& client, const HallOptions& options) {
  return await_start(client, options, ask_to_start(client, options));
}

Status end(const HallConnection& client, const std::string& name) {
  if (!hall::is_name(name))
    return Error{ErrorCode::Usage, printable(name, 64) + ": is no name of a session, see list"};
  const auto session =
      client.ask("DELETE", "/sessions/" + name, "", HallServer::kEndDeadline + kAnswer);
  if (!session) return session.error();
  print(fmt::format("{}: {}, recorded in {}\n", name, word(*session, "state"),
                    word(*session, "recording")));
  return {};
}

// ---- all halls of a bus ----

double room_of(const Json& hall) {
  return number(hall, "cores") - number(hall, "cores_taken");
}

bool has_session(const Json& hall, const std::string& name) {
  const auto sessions = hall.value("sessions", Json::array());
  return std::ranges::any_of(sessions, [&](const Json& session) {
    return session.is_object() && word(session, "name") == name;
  });
}

bool may_start(const Json& hall, const std::string& what) {
  const auto offers = hall.value("may_start", Json::array());
  const auto sessions = hall.value("sessions", Json::array());
  return std::ranges::find(offers, Json(what)) != offers.end() &&
         static_cast<double>(sessions.size()) < number(hall, "sessions_most");
}

// A name of a hall is a part of a subject.
bool is_hall_name(const std::string& name) {
  const auto is_fine = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-';
  };
  return !name.empty() && name.size() <= 128 && std::ranges::all_of(name, is_fine);
}

// Returns those that answer, the one with the most room first.
std::vector<Json> halls_of(bus::Bus& bus) {
  std::vector<Json> halls;
  for (const auto& text : bus.ask_all(kDirectorySubject, "", kBusWait, kFirstWait)) {
    auto hall = Json::parse(text, nullptr, false);
    if (hall.is_object() && is_hall_name(word(hall, "hall"))) halls.push_back(std::move(hall));
  }
  std::ranges::stable_sort(halls,
                           [](const Json& a, const Json& b) { return room_of(a) > room_of(b); });
  return halls;
}

void list_all(const std::vector<Json>& halls, bool is_json) {
  if (is_json) return print(to_text(Json{{"halls", halls}}));
  for (const auto& hall : halls) {
    print(word(hall, "hall") + "\n");
    print_directory(hall);
  }
}

Status start_anywhere(bus::Bus& bus, const std::vector<Json>& halls, const HallOptions& options,
                      const std::string& key) {
  Error why{ErrorCode::Refused,
            options.what + ": no hall that answers may start it, see list --nats"};
  for (const auto& hall : halls) {
    if (!may_start(hall, options.what)) continue;
    const auto name = word(hall, "hall");
    const BusHallClient client(bus, name, word(hall, "start"), key);
    auto asked = ask_to_start(client, options);
    // Only a hall that has said no has certainly started nothing: then the next one is asked.
    const bool is_refused = !asked && asked.error().code == ErrorCode::Refused;
    const auto started = await_start(client, options, std::move(asked));
    if (started) return {};
    why = {started.error().code, name + ": " + started.error().message};
    if (!is_refused) break;
  }
  return why;
}

Status end_anywhere(bus::Bus& bus, const std::vector<Json>& halls, const std::string& name,
                    const std::string& key) {
  std::vector<Json> with_it;
  std::ranges::copy_if(halls, std::back_inserter(with_it),
                       [&](const Json& hall) { return has_session(hall, name); });
  if (with_it.empty())
    return Error{ErrorCode::Refused,
                 printable(name, 64) + ": no hall that answers has such a session"};
  if (with_it.size() > 1)
    return Error{ErrorCode::Refused, name + ": " + word(with_it[0], "hall") + " and " +
                                         word(with_it[1], "hall") +
                                         " both have such a session, end it with --at HOST:PORT"};
  return end(BusHallClient(bus, word(with_it[0], "hall"), word(with_it[0], "start"), key), name);
}

// Says which halls do not know the key. One that does not answer in time is not among them.
Status check_key(bus::Bus& bus, const std::vector<Json>& halls, const std::string& key) {
  std::string refused;
  for (const auto& hall : halls) {
    const auto name = word(hall, "hall");
    const BusHallClient client(bus, name, word(hall, "start"), key);
    // The answer is no JSON and holds no code; a hall that does not believe the proof says no.
    const auto asked = client.ask("GET", "/healthz", "", kKeyAnswer);
    if (!asked && asked.error().code == ErrorCode::Refused)
      refused += (refused.empty() ? "" : ", ") + name + ": " + asked.error().message;
  }
  return refused.empty() ? Status() : Status(Error{ErrorCode::Refused, "--key: " + refused});
}

Status run_on_bus(const HallOptions& options, const std::string& key) {
  const auto bus = bus::Bus::connect(options.nats, "trocar-hall command", false);
  if (!bus) return bus.error();
  const auto halls = halls_of(**bus);
  if (halls.empty())
    return Error{ErrorCode::ResourceMissing,
                 options.nats.url + ": no hall answers: start trocar-hall with this --nats"};
  if (options.command == HallCommand::Start) return start_anywhere(**bus, halls, options, key);
  if (options.command == HallCommand::End) return end_anywhere(**bus, halls, options.what, key);
  list_all(halls, options.is_json);
  return key.empty() ? Status() : check_key(**bus, halls, key);
}

}  // namespace

Status run_hall_command(const HallOptions& options) {
  std::string key;
  if (!options.key_file.empty()) {
    auto read = read_key(options.key_file);
    if (!read) return Error{read.error().code, "--key: " + read.error().message};
    key = std::move(*read);
  }
  if (!options.nats.url.empty()) return run_on_bus(options, key);
  const bool is_here = options.host == "localhost" || secure::is_loopback(options.host);
  if (!key.empty() && !options.has_tls && !is_here && !options.sends_openly)
    return Error{ErrorCode::Usage,
                 "--key: others could read it on its way to " + options.host +
                     ": give --at https://HOST:PORT, or --without-tls where you trust the network"};
  Bytes certificate_der;
  if (!options.certificate_file.empty()) {
    const auto text = secure::read_small_file(options.certificate_file);
    if (!text) return Error{text.error().code, "--certificate: " + text.error().message};
    auto der = secure::certificate_der(*text, "--certificate: " + options.certificate_file);
    if (!der) return der.error();
    certificate_der = std::move(*der);
  }
  const auto tls = !options.has_tls          ? nullptr
                   : certificate_der.empty() ? secure::make_client_context_with_system_cas()
                                             : secure::make_client_context();
  const HallClient client(options.host, options.port, key, tls, certificate_der);
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
