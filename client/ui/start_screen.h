#pragma once

// The start screen asks what nobody has said yet: what to do, and who it is. One joins a session,
// practises alone, hosts a lesson, or watches a recording. It fills the window, over Hud's
// begin_frame and before its render. Thread: render thread.

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

// Something to do with goals and points, on an organ of its own.
struct StartTask {
  std::string name;  // as trocar-server --lesson takes it
  std::string title, text;
};

// A lesson that this window hosts, and how others get in.
struct StartLesson {
  std::string address;             // "theatre-1:7690"
  std::vector<std::string> codes;  // a line for each role
  std::string recording;           // the file; empty: none
};

struct StartModel {
  std::vector<StartSession> sessions;
  std::vector<StartTask> tasks;
  std::vector<std::string> recordings;  // files that are at hand, newest first
  std::optional<StartLesson> lesson;    // runs
  std::string no_sessions_text;         // why there are none, if it is known
  std::string message;                  // what the last try came to; empty: nothing
};

enum class StartDeed { Join, Practise, Host, Watch, TakePart, EndLesson };

// Holds what the person has typed and chosen.
struct StartChoice {
  StartDeed deed = StartDeed::Join;
  std::string organ = "liver";  // to practise on, or of the lesson
  std::string task;             // instead of an organ; empty: none
  bool is_recorded = true;      // likewise
  std::string recording;        // to watch
  std::string beside;           // a second one; empty: none
  std::string server, code, name;
  replica::Role role = replica::Role::Surgeon;
  bool brings_tools = false;  // an instructor who holds instruments, too
};

class StartScreen {
 public:
  explicit StartScreen(const StartChoice& preset);

  // The choice, when the person wants it.
  // `is_entered`: Enter was pressed.
  std::optional<StartChoice> draw(const StartModel& model, bool is_entered);
  // Whether the person has done anything here.
  bool is_touched() const { return is_touched_; }
  const char* name() const { return name_.data(); }  // as typed so far

 private:
  static void draw_title();
  void draw_sessions(const StartModel& model);
  void draw_join(const StartModel& model);
  void draw_own(StartDeed deed, const StartModel& model);
  void draw_task(const StartModel& model);
  void draw_lesson(const StartLesson& lesson);
  void draw_recordings(const StartModel& model);
  void draw_person();
  void draw_role();
  bool big_button(const char* text);
  StartChoice choice(StartDeed deed) const;

  std::array<char, 128> server_{};
  std::array<char, 160> code_{};
  std::array<char, 33> name_{};
  std::array<char, 512> recording_{};
  std::string beside_;
  replica::Role role_;
  bool brings_tools_ = false;
  std::size_t organ_ = 0;
  std::string task_;
  bool is_recorded_ = true;
  bool has_turned_to_lesson_ = false;
  std::optional<StartDeed> wanted_;  // a button was pressed
  bool is_touched_ = false;
};

}  // namespace trocar::ui
