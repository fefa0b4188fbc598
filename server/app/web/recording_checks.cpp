#include "server/app/web/recording_checks.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/base/exit_code.h"
#include "common/base/json.h"
#include "common/base/log.h"
#include "common/base/own_folder.h"
#include "common/base/printable.h"
#include "common/base/version.h"
#include "common/secure/private_files.h"

namespace trocar::app {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kLook{200};
constexpr std::chrono::seconds kGrowing{5};
constexpr std::size_t kMostText = 500;

fs::path journal_program() {
  return own_folder() / "trocar-journal";
}

std::string answer(const std::string& state, const std::string& text, const Json& tick = {}) {
  return to_text({{"state", state}, {"text", text}, {"tick", tick}});
}

bool is_growing(const site::OpenRecording& recording) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const auto age = now - std::chrono::nanoseconds(recording.changed_ns());
  return age >= std::chrono::nanoseconds(0) && age < kGrowing;
}

// The last line, without the program's name before it.
std::string reason_in(const std::string& errors) {
  const auto end = errors.find_last_not_of('\n');
  if (end == std::string::npos) return "the check has ended without a word";
  const auto begin = errors.rfind('\n', end);
  auto line = errors.substr(begin == std::string::npos ? 0 : begin + 1,
                            end - (begin == std::string::npos ? 0 : begin + 1) + 1);
  for (const std::string before : {"trocar-journal: ", "/proc/self/fd/3: "})
    if (line.starts_with(before)) line.erase(0, before.size());
  return line;
}

}  // namespace

RecordingChecks::RecordingChecks(asio::io_context& context, fs::path state_folder,
                                 std::chrono::seconds limit)
    : program_(journal_program()),
      folder_(std::move(state_folder) / "checks"),
      limit_(limit),
      timer_(context) {}

fs::path RecordingChecks::file_of(const std::string& name) const {
  return folder_ / (name + ".json");
}

std::optional<std::string> RecordingChecks::kept(const std::string& name,
                                                 const site::OpenRecording& recording) const {
  std::error_code ignored;
  if (!fs::exists(file_of(name), ignored)) return std::nullopt;
  const auto text = secure::read_private_file(file_of(name));
  if (!text) return std::nullopt;
  try {
    const auto json = Json::parse(*text);
    if (whole_number<std::uint64_t>(json, "size") != recording.size() ||
        whole_number<std::int64_t>(json, "changed_ns") != recording.changed_ns() ||
        whole_number<std::uint32_t>(json, "sim_version") != kSimVersion)
      return std::nullopt;
    return answer(json.at("state").get<std::string>(), json.at("text").get<std::string>(),
                  json.at("tick"));
  } catch (const std::exception&) {
    return std::nullopt;  // it is made anew
  }
}

std::string RecordingChecks::known(const std::string& name,
                                   const site::OpenRecording& recording) const {
  const auto task = std::ranges::find(tasks_, name, &Task::name);
  if (task == tasks_.begin() && process_) {
    const auto now = std::chrono::steady_clock::now();
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(now - begun_).count();
    return answer("running", fmt::format("It is being checked, for {} s so far.", seconds));
  }
  if (task != tasks_.end())
    return answer("waiting",
                  fmt::format("Others are checked before it: {}.", task - tasks_.begin()));
  if (auto known = kept(name, recording)) return *known;
  if (const auto failed = failed_.find(name); failed != failed_.end()) return failed->second;
  return answer("not asked", "Nobody has asked whether it verifies.");
}

std::string RecordingChecks::ask(const std::string& name,
                                 std::unique_ptr<site::OpenRecording> recording) {
  const bool is_known = std::ranges::find(tasks_, name, &Task::name) != tasks_.end() ||
                        kept(name, *recording).has_value();
  if (is_known) return known(name, *recording);
  if (is_growing(*recording)) return answer("growing", "It is still being written.");
  if (tasks_.size() > kMostWaiting)
    return answer("waiting", "Too many recordings wait for their check: ask again later.");
  failed_.erase(name);
  const auto& opened = *recording;
  tasks_.push_back({name, std::move(recording)});
  if (tasks_.size() == 1) begin_next();
  return known(name, opened);
}

void RecordingChecks::begin_next() {
  while (!tasks_.empty() && !process_) {
    const auto& task = tasks_.front();
    auto started = CheckProcess::start(program_, task.recording->file());
    if (started) {
      log::info("checks whether {} verifies", printable(task.name, 128));
      process_.emplace(std::move(*started));
      begun_ = std::chrono::steady_clock::now();
      look();
      return;
    }
    fail(task, started.error().message);
    tasks_.pop_front();
  }
}

void RecordingChecks::look() {
  timer_.expires_after(kLook);
  timer_.async_wait([this](boost::system::error_code error) {
    if (error || !process_) return;
    const bool is_late = std::chrono::steady_clock::now() - begun_ > limit_;
    const auto outcome = process_->poll();
    if (!outcome && !is_late) return look();
    if (outcome)
      keep(tasks_.front(), *outcome);
    else
      fail(tasks_.front(), fmt::format("the check took longer than {} s", limit_.count()));
    process_.reset();
    tasks_.pop_front();
    begin_next();
  });
}

void RecordingChecks::fail(const Task& task, const std::string& why) {
  log::warn("{}: {}", printable(task.name, 128), why);
  if (failed_.size() >= kMostWaiting) failed_.clear();
  failed_[task.name] = answer("failed", why);
}

void RecordingChecks::keep(const Task& task, const CheckProcess::Outcome& outcome) {
  if (!outcome.exit_code) return fail(task, "the check was ended by a signal");
  try {
    const auto report = Json::parse(outcome.output);
    const auto& difference = report.at("first_difference");
    if (outcome.exit_code == static_cast<int>(ExitCode::Ok))
      return keep(task, "verified",
                  fmt::format("{} ticks simulated again, each with an equal hash",
                              whole_number<std::uint64_t>(report, "ticks_verified")),
                  std::nullopt);
    if (outcome.exit_code == static_cast<int>(ExitCode::Mismatch)) {
      const auto text = [&](const char* key) { return difference.at(key).get<std::string>(); };
      return keep(task, "different",
                  fmt::format("{}: {} is {}, simulated {}", text("channel"), text("field"),
                              text("recorded"), text("simulated")),
                  whole_number<std::uint64_t>(difference, "tick"));
    }
    return keep(task, "unknown", report.at("reasons").at(0).get<std::string>(), std::nullopt);
  } catch (const std::exception&) {
    keep(task, "unknown", reason_in(outcome.errors), std::nullopt);
  }
}

void RecordingChecks::keep(const Task& task, const std::string& state, const std::string& text,
                           std::optional<std::uint64_t> tick) {
  const auto line = printable(text, kMostText);
  log::info("{}: {}, {}", printable(task.name, 128), state, line);
  const Json json{{"size", task.recording->size()},
                  {"changed_ns", task.recording->changed_ns()},
                  {"sim_version", kSimVersion},
                  {"state", state},
                  {"text", line},
                  {"tick", tick ? Json(*tick) : Json()}};
  auto written = secure::make_private_folder(folder_);
  if (written) written = secure::write_private_file(file_of(task.name), to_text(json));
  if (!written) log::warn("what came out cannot be kept: {}", written.error().message);
}

void RecordingChecks::stop() {
  timer_.cancel();
  process_.reset();
  tasks_.clear();
}

}  // namespace trocar::app
