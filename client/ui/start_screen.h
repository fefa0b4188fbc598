#pragma once

// The start screen asks what nobody has said yet: which session, who, and with which code. It fills
// the window, over Hud's begin_frame and before its render. Thread: render thread.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "client/replica/session_view.h"

namespace trocar::ui {

struct StartSession {
  std::string name, organ;
  std::string server;  // "HOST:PORT"
  int people = 0;
  bool needs_code = true;
};

struct StartModel {
  std::vector<StartSession> sessions;
  std::string no_sessions_text;  // why there are none, if it is known
  std::string message;           // what the last try came to; empty: nothing
};

// Holds what the person has typed and chosen.
struct StartChoice {
  std::string server, code, name;
  replica::Role role = replica::Role::Surgeon;
};

class StartScreen {
 public:
  explicit StartScreen(const StartChoice& preset);

  // The choice, when the person wants to join with it.
  // `is_entered`: Enter was pressed.
  std::optional<StartChoice> draw(const StartModel& model, bool is_entered);
  // Whether the person has done anything here.
  bool is_touched() const { return is_touched_; }
  const char* name() const { return name_.data(); }  // as typed so far

 private:
  void draw_sessions(const StartModel& model);
  void draw_role();
  StartChoice choice() const;

  std::array<char, 128> server_{};
  std::array<char, 160> code_{};
  std::array<char, 33> name_{};
  replica::Role role_;
  bool is_touched_ = false;
};

}  // namespace trocar::ui
