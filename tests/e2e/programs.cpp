#include "tests/e2e/programs.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <sstream>
#include <thread>

#include "common/journal/session_journal.h"

extern char** environ;

namespace trocar::e2e {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

Program::Program(const std::string& name, const std::vector<std::string>& arguments,
                 const fs::path& log) {
  const std::string path = TROCAR_BINARY_DIR "/" + name;
  std::vector<char*> argv{const_cast<char*>(path.c_str())};
  for (const auto& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 1, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  posix_spawn_file_actions_adddup2(&actions, 1, 2);
  const int failed = posix_spawn(&pid_, path.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  EXPECT_EQ(failed, 0) << "cannot start " << path;
  has_ended_ = failed != 0;
}

Program::Program(Program&& other) noexcept
    : pid_(other.pid_), status_(other.status_), has_ended_(other.has_ended_) {
  other.has_ended_ = true;
}

Program::~Program() {
  if (has_ended_) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
}

void Program::signal(int number) const {
  kill(pid_, number);
}

bool Program::is_running() {
  if (!has_ended_ && waitpid(pid_, &status_, WNOHANG) == pid_) has_ended_ = true;
  return !has_ended_;
}

int Program::wait(double seconds) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (is_running()) {
    if (std::chrono::steady_clock::now() > end) return -1;
    std::this_thread::sleep_for(milliseconds(10));
  }
  return WIFEXITED(status_) ? WEXITSTATUS(status_) : 128 + WTERMSIG(status_);
}

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
  for (int i = 0; i < static_cast<int>(seconds * 50); ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(milliseconds(20));
  }
  return false;
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
