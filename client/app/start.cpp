#include "client/app/start.h"

#include <algorithm>
#include <chrono>
#include <mutex>
#include <thread>

#include "client/app/client.h"
#include "client/net/net_source.h"
#include "client/ui/hud.h"
#include "client/ui/start_screen.h"
#include "common/base/background.h"
#include "common/base/timing.h"
#include "common/discovery/finder.h"
#include "common/secure/join_code.h"
#include "common/secure/link_file.h"

namespace trocar::app {
namespace {

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

}  // namespace

bool wants_start_screen(const ClientOptions& options) {
  if (options.display != Display::Window || options.is_told_where) return false;
  return options.chooses || !has_own_server();
}

Result<std::optional<ClientOptions>> choose_session(ClientOptions options,
                                                    const std::string& message) {
  auto context = render::make_window_context(options.size, "Trocar");
  if (!context) return context.error();
  ui::Hud hud(**context, options.scale);
  const bool has_tried = !message.empty();
  ui::StartScreen screen(
      {has_tried ? options.server : "", options.join, options.name, options.role});
  Lookout lookout;
  ui::StartModel model{.sessions = {}, .no_sessions_text = {}, .message = message};
  while (!(*context)->should_close() && !is_stop_requested()) {
    const auto begin = monotonic_ns();
    lookout.update(model);
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
    if (choice) {
      const auto applied = apply(*choice, options);
      if (applied) return std::optional(std::move(options));
      model.message = applied.error().message;
    }
    const auto taken = monotonic_ns() - begin;
    if (taken < kPictureNs)
      std::this_thread::sleep_for(std::chrono::nanoseconds(kPictureNs - taken));
  }
  return std::optional<ClientOptions>();
}

}  // namespace trocar::app
