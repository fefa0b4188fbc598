#include "tests/e2e/programs.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <sstream>
#include <thread>

#include "common/journal/session_journal.h"

namespace trocar::e2e {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

fs::path test_folder() {
  const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
  std::string name = std::string(test->test_suite_name()) + "." + test->name();
  for (char& c : name)
    if (c == '/') c = '_';
  const fs::path folder = fs::temp_directory_path() / ("trocar-" + std::to_string(getpid())) / name;
  fs::create_directories(folder);
  return folder;
}

std::string read_text(const fs::path& file) {
  std::ifstream in(file);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

std::string json_value(const std::string& json, const std::string& key) {
  const std::string quoted = "\"" + key + "\":";
  auto at = json.find(quoted);
  if (at == std::string::npos) return {};
  at = json.find_first_not_of(" \n", at + quoted.size());
  if (json[at] == '"') return json.substr(at + 1, json.find('"', at + 1) - at - 1);
  return json.substr(at, json.find_first_of(",}\n", at) - at);
}

double json_number(const std::string& json, const std::string& key) {
  const auto text = json_value(json, key);
  EXPECT_FALSE(text.empty()) << key << " is missing in " << json;
  return text.empty() ? 0 : std::stod(text);
}

bool wait_until(const std::function<bool()>& condition, double seconds) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration<double>(seconds);
  while (Clock::now() < end) {
    const auto before = Clock::now();
    if (condition()) return true;
    // To read a long recording costs the session's own processor time: four fifths of it are left.
    std::this_thread::sleep_for(
        std::max<Clock::duration>(milliseconds(20), 4 * (Clock::now() - before)));
  }
  return condition();
}

bool wait_for_file(const fs::path& file, double seconds) {
  return wait_until([&] { return fs::exists(file) && fs::file_size(file) > 0; }, seconds);
}

Invitation find_invitation(const fs::path& log, const std::string& role) {
  std::istringstream lines(read_text(log));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string first;
    Invitation found;
    words >> first >> found.code >> found.link;
    if (first == role) return found;
  }
  ADD_FAILURE() << "no code for " << role << " in " << log;
  return {};
}

std::string ready_address(const fs::path& ready_file) {
  std::string port = read_text(ready_file);
  port.erase(port.find_last_not_of(" \n") + 1);
  return "127.0.0.1:" + port.substr(port.rfind(':') + 1);
}

std::vector<std::string> at_pace(int people, std::vector<std::string> more) {
  more.insert(more.end(), {"--wait-for", std::to_string(people), "--pace", "10"});
  return more;
}

namespace {

std::vector<std::string> server_arguments(const fs::path& folder, const fs::path& journal,
                                          const std::string& organ,
                                          const std::vector<std::string>& extra) {
  std::vector<std::string> arguments{"--organ",      organ,
                                     "--listen",     "127.0.0.1:0",
                                     "--journal",    journal.string(),
                                     "--summary",    (folder / "server.json").string(),
                                     "--ready-file", (folder / "ready").string()};
  arguments.insert(arguments.end(), extra.begin(), extra.end());
  return arguments;
}

}  // namespace

Session::Session(const std::string& organ, const std::vector<std::string>& extra)
    : server_("trocar-server", server_arguments(folder, journal, organ, extra),
              folder / "server.log") {
  EXPECT_TRUE(wait_for_file(folder / "ready", 60)) << read_text(folder / "server.log");
  address_ = ready_address(folder / "ready");
}

Program Session::client(const std::string& name, const std::string& role,
                        const std::vector<std::string>& extra) {
  std::vector<std::string> arguments{
      "--server", address_, "--name",    name,
      "--role",   role,     "--summary", (folder / (name + ".json")).string()};
  if (std::ranges::find(extra, "--headless") == extra.end()) arguments.push_back("--no-render");
  arguments.insert(arguments.end(), extra.begin(), extra.end());
  return Program("trocar-client", arguments, folder / (name + ".log"));
}

Program Session::hand(const std::string& name, const fs::path& script) {
  return client(name, "surgeon", {"--script", script.string()});
}

bool Session::wait_for_tick(Tick tick, double seconds) const {
  return wait_until(
      [&] {
        const auto recorded = journal::SessionJournal::open(journal.string());
        return recorded.ok() && (*recorded)->info().last_tick >= tick;
      },
      seconds);
}

}  // namespace trocar::e2e
