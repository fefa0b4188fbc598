#include "client/app/start.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <ctime>
#include <filesystem>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

#include "client/app/client.h"
#include "client/app/remembered.h"
#include "client/net/net_source.h"
#include "client/ui/hud.h"
#include "client/ui/start_screen.h"
#include "common/base/background.h"
#include "common/base/timing.h"
#include "common/discovery/finder.h"
#include "common/lesson/lesson.h"
#include "common/lesson/lesson_texts.h"
#include "common/secure/join_code.h"
#include "common/secure/link_file.h"
#include "common/secure/private_files.h"
#include "common/wire/role.h"

namespace trocar::app {
namespace {

namespace fs = std::filesystem;

constexpr const char* kOwnServer = "127.0.0.1:7690";
constexpr std::uint16_t kOwnPort = 7690;
constexpr double kLookSeconds = 1;
constexpr std::uint64_t kPictureNs = 16'666'667;

bool has_own_server() {
  return secure::read_link_file(kOwnPort, "observer").ok();
}

// Looks again and again, on a thread of its own.
class Lookout {
 public:
  // Brings the list of `model` up to date.
  void update(ui::StartModel& model) {
    if (!looking_.is_busy()) look();
    const std::lock_guard lock(mutex_);
    model.sessions = sessions_;
    model.no_sessions_text = text_;
  }

 private:
  void look() {
    looking_.start([this] {
      auto found = discovery::find_sessions(kLookSeconds);
      // Without an Avahi daemon that fails at once.
      if (!found) std::this_thread::sleep_for(std::chrono::duration<double>(kLookSeconds));
      const bool is_own_there = has_own_server();
      const std::lock_guard lock(mutex_);
      sessions_.clear();
      if (is_own_there) sessions_.push_back({"this machine", "", kOwnServer, 0, false});
      if (found)
        for (const auto& one : *found)
          sessions_.push_back({one.notice.name, one.notice.organ,
                               one.address + ":" + std::to_string(one.port), one.notice.people,
                               one.notice.needs_code});
      text_ = found ? "No session announces itself on this network. Paste a link, or start "
                      "trocar-server."
                    : "Sessions of this network are not listed, because no Avahi daemon runs here. "
                      "Paste a link, or start trocar-server.";
    });
  }

  std::mutex mutex_;
  std::vector<ui::StartSession> sessions_;
  std::string text_;
  Background looking_;
};

// Puts the choice into the options, or says what is wrong with it.
Status apply(const ui::StartChoice& choice, ClientOptions& options) {
  const std::string_view spaces = " \t\n\r";
  const auto trimmed = [&](std::string text) {
    text.erase(text.begin(), std::ranges::find_if(text, [&](char c) {
                 return spaces.find(c) == std::string_view::npos;
               }));
    const auto last = text.find_last_not_of(spaces);
    return last == std::string::npos ? std::string() : text.substr(0, last + 1);
  };
  options.join = trimmed(choice.code);
  options.server = trimmed(choice.server);
  options.name = trimmed(choice.name);
  options.role = choice.role;
  options.brings_tools = choice.brings_tools;
  if (!options.join.empty()) {
    const auto invitation = secure::parse_invitation(options.join);
    if (!invitation) return invitation.error();
    if (!invitation->server.empty()) options.server = invitation->server;
  }
  if (options.server.empty())
    return Error{ErrorCode::Usage, "choose a session, paste a link, or say where the server is"};
  net::NetSourceOptions parsed;
  return net::parse_server_address(options.server, parsed);
}

// Recordings of the current folder, newest first.
std::vector<std::string> recordings_at_hand() {
  constexpr std::size_t kMost = 12;
  std::vector<std::pair<fs::file_time_type, std::string>> found;
  std::error_code error;
  for (fs::directory_iterator at(".", error), end; !error && at != end; at.increment(error)) {
    std::error_code gone;
    const auto time = at->last_write_time(gone);
    if (!gone && at->path().extension() == ".mcap")
      found.emplace_back(time, at->path().filename().string());
  }
  std::ranges::sort(found, std::greater{});
  std::vector<std::string> names;
  for (auto& [time, name] : found)
    if (names.size() < kMost) names.push_back(std::move(name));
  return names;
}

std::string own_code() {
  const auto code = secure::read_link_file(kOwnPort, "observer");
  return code ? secure::to_text(*code) : std::string();
}

fs::path new_recording() {
  const auto now = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
  const auto time = std::chrono::system_clock::to_time_t(now);
  std::tm utc{};
  gmtime_r(&time, &utc);
  std::array<char, 64> name{};
  std::strftime(name.data(), name.size(), "trocar-%Y%m%d-%H%M%S.mcap", &utc);
  std::error_code error;
  return fs::absolute(name.data(), error);
}

Status start_own(const ui::StartChoice& choice, std::unique_ptr<OwnServer>& own) {
  const auto folder = secure::default_state_folder();
  if (!folder) return folder.error();
  if (const auto made = secure::make_private_folder(*folder); !made) return made;
  OwnServer::Settings settings{.organ = choice.organ,
                               .lesson = choice.task,
                               .is_for_network = choice.deed == ui::StartDeed::Host};
  if (choice.is_recorded) settings.recording = new_recording();
  auto started = OwnServer::start(settings, *folder / "own-server.log");
  if (!started) return started.error();
  own = std::move(*started);
  return {};
}

std::vector<ui::StartTask> tasks() {
  std::vector<ui::StartTask> tasks;
  for (const auto& each : lesson::lesson_texts())
    if (const auto lesson = lesson::read_lesson_text(each.text, each.name))
      tasks.push_back({each.name, lesson->title, lesson->text});
  return tasks;
}

ui::StartLesson lesson_of(const OwnServer& own) {
  std::array<char, 256> host{};
  ::gethostname(host.data(), host.size() - 1);
  ui::StartLesson lesson{.address = std::string(host.data()) + ":" + std::to_string(kOwnPort),
                         .codes = {},
                         .recording = own.settings().recording.string()};
  for (const auto& known : wire::kRoles)
    if (const auto code = secure::read_link_file(kOwnPort, known.name))
      lesson.codes.push_back(std::string(known.name) + ": " + secure::to_text(*code));
  return lesson;
}

// This is the server that the person starts on this machine, from the wish to where it can be
// joined.
class OwnStart {
 public:
  explicit OwnStart(std::unique_ptr<OwnServer>& own) : own_(own), is_up_(own != nullptr) {}

  Status begin(const ui::StartChoice& choice) {
    code_before_ = own_code();  // a server that was killed has left one
    is_up_ = false;
    return start_own(choice, own_);
  }
  void end() { own_.reset(); }
  bool is_running() { return own_ && own_->is_running(); }
  // Brings `model` up to date. Returns whether there is a place to practise, just now.
  bool update(ui::StartModel& model) {
    model.lesson.reset();
    if (own_ && !own_->is_running()) {
      model.message = own_->last_words();
      own_.reset();
    }
    if (!own_) return false;
    const auto code = own_code();
    const bool was_up = std::exchange(is_up_, is_up_ || (!code.empty() && code != code_before_));
    if (!is_up_) {
      const auto& settings = own_->settings();
      model.message = "The server starts, with " +
                      (settings.lesson.empty() ? settings.organ : settings.lesson) + " ...";
      return false;
    }
    if (!was_up) model.message.clear();
    if (own_->settings().is_for_network) model.lesson = lesson_of(*own_);
    return !was_up && !own_->settings().is_for_network;
  }

 private:
  std::unique_ptr<OwnServer>& own_;
  std::string code_before_;
  bool is_up_;
};

void use_own(const ui::StartChoice& choice, ClientOptions& options) {
  options.server = kOwnServer;
  options.join.clear();
  if (!choice.name.empty()) options.name = choice.name;
  options.role = choice.deed == ui::StartDeed::Practise ? replica::Role::Surgeon : choice.role;
  options.brings_tools = choice.brings_tools && options.role == choice.role;
}

}  // namespace

bool wants_start_screen(const ClientOptions& options) {
  if (options.display != Display::Window || options.is_told_where) return false;
  return options.chooses || !has_own_server();
}

Result<std::optional<ClientOptions>> choose_session(ClientOptions options,
                                                    const std::string& message,
                                                    std::unique_ptr<OwnServer>& own,
                                                    const std::optional<std::string>& lesson) {
  auto context = render::make_window_context(options.size, "Trocar");
  if (!context) return context.error();
  ui::Hud hud(**context, options.scale);
  const bool has_tried = !message.empty() || own != nullptr || lesson;
  options.replay_file.clear();
  options.beside_file.clear();
  if (const auto person = remembered_person(); person && !options.is_told_who && !has_tried) {
    options.name = person->name;
    options.role = person->role;
  }
  ui::StartScreen screen({.server = has_tried && !own ? options.server : "",
                          .code = options.join,
                          .name = options.name,
                          .role = options.role,
                          .brings_tools = options.brings_tools});
  Lookout lookout;
  OwnStart own_start(own);
  ui::StartModel model{.tasks = tasks(), .recordings = recordings_at_hand(), .message = message};
  ui::StartChoice practice;
  if (lesson) {
    practice = {.deed = ui::StartDeed::Practise, .task = *lesson, .name = options.name};
    if (const auto begun = own_start.begin(practice); !begun) model.message = begun.error().message;
  }
  while (!(*context)->should_close() && !is_stop_requested()) {
    const auto begin = monotonic_ns();
    lookout.update(model);
    const bool can_practise = own_start.update(model);
    (*context)->poll_events();
    hud.begin_frame(1.0f / 60);
    for (const auto& session : model.sessions) {
      hud.need(session.name);
      hud.need(session.organ);
    }
    hud.need(screen.name());
    const auto choice = screen.draw(model, ui::Hud::take_enter());
    hud.render();
    (*context)->present();
    const bool joins_by_itself = !options.chooses && !has_tried && !screen.is_touched() &&
                                 !model.sessions.empty() &&
                                 model.sessions.front().server == kOwnServer;
    if (joins_by_itself) return std::optional(std::move(options));
    if (can_practise) {
      use_own(practice, options);
      return std::optional(std::move(options));
    }
    if (choice) {
      const auto done = [&]() -> Result<bool> {  // true: there is a session to go to
        switch (choice->deed) {
          case ui::StartDeed::Practise:
          case ui::StartDeed::Host:
            remember({choice->name, choice->role});
            practice = *choice;
            if (own_start.is_running()) return false;
            if (const auto begun = own_start.begin(*choice); !begun) return begun.error();
            return false;
          case ui::StartDeed::EndLesson:
            own_start.end();
            return false;
          case ui::StartDeed::TakePart:
            remember({choice->name, choice->role});
            use_own(*choice, options);
            return true;
          case ui::StartDeed::Watch:
            if (choice->recording.empty())
              return Error{ErrorCode::Usage, "choose a recording, or write its file's name"};
            options.replay_file = choice->recording;
            options.beside_file = choice->beside;
            return true;
          case ui::StartDeed::Join:
            break;
        }
        if (const auto applied = apply(*choice, options); !applied) return applied.error();
        remember({choice->name, choice->role});
        return true;
      }();
      if (done && *done) return std::optional(std::move(options));
      model.message = done ? "" : done.error().message;
    }
    const auto taken = monotonic_ns() - begin;
    if (taken < kPictureNs)
      std::this_thread::sleep_for(std::chrono::nanoseconds(kPictureNs - taken));
  }
  return std::optional<ClientOptions>();
}

}  // namespace trocar::app
