#include "client/app/hud_content.h"

#include <algorithm>
#include <cstdio>

#include <fmt/format.h>

#include "client/ui/away_text.h"
#include "client/ui/banner_text.h"
#include "client/ui/rate_text.h"
#include "common/lesson/advice.h"
#include "common/tool/instrument.h"

namespace trocar::app {
namespace {

std::string sync_text(const replica::Replica& replica) {
  char text[80];
  const auto& counters = replica.counters();
  switch (replica.sync_state()) {
    case replica::SyncState::WaitingForTopology:
    case replica::SyncState::WaitingForKeyframe:
      return "waiting";
    case replica::SyncState::Healing:
      return "healing: keyframe asked for";
    case replica::SyncState::InStep:
      std::snprintf(text, sizeof text,
                    counters.healed > 0 ? "in step, CRC %08x, healed %llu" : "in step, CRC %08x",
                    replica.surface_crc(), static_cast<unsigned long long>(counters.healed));
      return text;
  }
  return {};
}

// The state of the newest frame may still be under way; then the one before has it.
wire::FrameFigures figures_of(const replica::Replica& replica) {
  const auto* newest = replica.newest();
  if (newest == nullptr) return {};
  const auto& history = replica.history();
  const bool is_complete = newest->has_state || history.size() < 2;
  return (is_complete ? *newest : history[history.size() - 2]).figures;
}

std::vector<std::string> instruments_of(const std::vector<tool::ToolShape>& shapes) {
  std::vector<std::string> names;
  for (const auto& shape : shapes) {
    const auto known = std::ranges::find(tool::instruments(), shape, &tool::Instrument::shape);
    names.push_back(known != tool::instruments().end() ? known->name : "instrument");
  }
  return names;
}

}  // namespace

ui::HudTray tray_of(const Hands::Choice& choice) {
  ui::HudTray tray{.chosen = choice.chosen, .hand = choice.hand, .hands = choice.hands};
  for (const auto& instrument : choice.table) {
    tray.names.push_back(instrument.name);
    tray.texts.push_back(instrument.text);
  }
  return tray;
}

std::vector<ui::HudParticipant> participants_of(const replica::Replica& replica, const Pane& pane,
                                                bool is_replay) {
  std::vector<ui::HudParticipant> participants;
  const auto waiting = figures_of(replica).pace.rate.waiting_tools;
  for (const auto& participant : replica.told().participants()) {
    ui::HudParticipant shown;
    shown.name = participant.name;
    if (participant.relayed > 0)
      shown.name += " (" + std::to_string(participant.relayed) + " watch)";
    shown.role = participant.role;
    shown.is_away = participant.is_away;
    shown.is_frozen = !participant.frozen_by.empty();
    shown.is_self = !is_replay && participant.slot == replica.own_slot();
    shown.colour = shape::colour_of_slot(participant.slot.value);
    for (const replica::Tool& tool : pane.surface().tools()) {
      if (tool.slot.owner() != participant.slot) continue;
      shown.has_tool = true;
      shown.is_silent = tool.is_silent;
      shown.is_inside = shown.is_inside || tool.is_inside;
      shown.waits = shown.waits || (waiting >> tool.slot.value & 1) != 0;
      if (tool.verb != tool::Verb::None) {
        shown.verb = tool.verb;
        shown.form = shape_of(replica, tool.slot).form;
        shown.has_claim = tool.has_claim;
      }
      shown.force_n += length(tool.force_n);
      shown.torque_nm += length(tool.torque_nm);
      shown.contact_nodes += tool.contact_nodes;
    }
    if (shown.has_tool) {
      const auto forces = pane.forces().forces(participant.slot);
      shown.forces_n.assign(forces.begin(), forces.end());
    }
    participants.push_back(std::move(shown));
  }
  return participants;
}

void add_person(const replica::Replica& replica, const Onlooker& onlooker, bool follows_view,
                ui::HudModel& model) {
  const auto* own = replica.told().find_participant(replica.own_slot());
  model.own_role =
      onlooker.is_replay ? "replay" : replica::name_of(own != nullptr ? own->role : onlooker.role);
  if (!onlooker.is_replay && own != nullptr) model.own_role += ", " + own->name;
  if (own != nullptr && !own->frozen_by.empty())
    model.frozen_text = own->frozen_by + " keeps your tools where they are.";
  model.has_loan = own != nullptr && own->lent_tools != 0;
  const auto& people = replica.told().participants();
  const auto leader = std::ranges::find_if(people, &replica::Participant::leads_view);
  if (leader != people.end() && leader->slot == replica.own_slot())
    model.view_text = "Others may follow your view.";
  else if (leader != people.end())
    model.view_text = follows_view ? "You follow the view of " + leader->name + ": V ends that."
                                   : "V follows the view of " + leader->name + ".";
}

void add_connection(const replica::SessionSource& source, bool has_organ, ui::HudModel& model) {
  model.title = source.name();
  if (source.state() == replica::SourceState::Connecting)
    model.status = "Connecting to " + source.name() + " ...";
  else if (source.state() == replica::SourceState::Away) {
    model.status = ui::describe_absence(source.statistics().away_seconds,
                                        source.statistics().away_left_seconds);
    model.status_advice = "Wait. If it lasts, check the network of this computer.";
  } else if (source.state() == replica::SourceState::Closed) {
    model.status = source.close_reason().text;
    model.status_advice = ui::advice_after(source.close_reason().kind);
  } else if (!has_organ)
    model.status = "Waiting for the organ ...";
  model.is_away = source.state() == replica::SourceState::Away ||
                  source.state() == replica::SourceState::Closed;
}

void add_figures(const replica::Replica& replica, const replica::SessionSource& source,
                 std::uint64_t now_ns, ui::HudModel& model) {
  if (!replica.topology().rest_positions.empty()) model.organ = replica.topology().organ_name;
  model.vertices = replica.topology().rest_positions.size();
  if (const auto* newest = replica.newest()) {
    model.figures = figures_of(replica);
    model.session_seconds = static_cast<double>(newest->tick) * 1e-3;
  }
  const auto statistics = source.statistics();
  model.round_trip_ms = statistics.round_trip_seconds * 1e3;
  if (statistics.has_server_clock)
    model.surface_age_ms =
        replica.age_ms(static_cast<double>(now_ns) * 1e-3 + statistics.server_offset_us);
  model.sync_text = model.is_away ? "old" : sync_text(replica);
  model.is_in_step = !model.is_away && replica.sync_state() == replica::SyncState::InStep;
}

void add_recording(const replica::Replica& replica, bool is_replay, ui::HudModel& model) {
  using Status = wire::RecordingStatus;
  const auto recorded = replica.told().recording().status;
  if (!is_replay && recorded != Status::Unknown)
    model.is_recorded = recorded == Status::Whole || recorded == Status::Gapped;
  model.recording_text = replica.told().recording().text;
  model.has_recording_ended = recorded == Status::Failed;
}

void add_own_forces(const replica::Replica& replica, const Pane& pane, ui::HudModel& model) {
  const auto own = replica.own_slot();
  std::size_t count = 0;
  for (const replica::Tool& tool : pane.surface().tools()) count += tool.slot.owner() == own;
  for (const replica::Tool& tool : pane.surface().tools()) {
    if (tool.slot.owner() != own) continue;
    const std::string hand =
        count > 1 ? tool.slot.number() == 0 ? "right hand" : "left hand" : "hand";
    model.own_forces.push_back(
        {"force on your " + hand, shape::colour_of_slot(own.value), length(tool.force_n)});
  }
  if (count == 0) return;
  const auto forces = pane.forces().forces(own);
  model.own_peak_n = *std::ranges::max_element(forces);
}

void add_lent_view(const replica::Replica& replica, const Pane& pane, bool is_replay,
                   ui::HudModel& model) {
  for (const replica::Tool& tool : pane.surface().tools())
    model.can_lend_view |= is_replay || tool::is_endoscope(shape_of(replica, tool.slot).form);
  if (!pane.camera().lens() || !pane.lent().slot()) return;
  const auto* owner = owner_of(replica, *pane.lent().slot());
  const std::string name = owner != nullptr ? owner->name : "somebody";
  const bool is_own = !is_replay && pane.lent().slot()->owner() == replica.own_slot();
  const std::string whose = is_own ? "your endoscope" : "the endoscope of " + name;
  model.lent_text = pane.camera().lens()->is_endoscope
                        ? "You see through " + whose + ": T goes on, right drag ends that."
                        : "You see from behind the tool of " + name + ": T goes on.";
}

void add_messages(const replica::Replica& replica, std::uint64_t now_ns, ui::HudModel& model) {
  for (const auto& notice : replica.told().notices()) {
    const double age =
        now_ns > notice.arrival_ns ? static_cast<double>(now_ns - notice.arrival_ns) * 1e-9 : 0.0;
    const bool is_own = notice.tool.owner() == replica.own_slot();
    const bool is_news =
        notice.is_for_all || (replica::is_refusal(notice.outcome)
                                  ? is_own
                                  : notice.outcome == replica::ClaimOutcome::TakenOver ||
                                        notice.outcome == replica::ClaimOutcome::Expired ||
                                        notice.outcome == replica::ClaimOutcome::Slipped);
    if (age > 5 || notice.text.empty() || !is_news) continue;
    const std::string text =
        ui::describe_notice(notice, is_own, shape_of(replica, notice.tool).reach_m);
    // A claim is retried while the verb is held: the same words once.
    if (!model.messages.empty() && model.messages.back().text == text) model.messages.pop_back();
    model.messages.push_back(
        {text, static_cast<float>(age), !notice.is_for_all || notice.is_refused});
  }
  if (model.messages.size() > 3)
    model.messages.erase(model.messages.begin(), model.messages.end() - 3);
}

void add_timeline(const replica::PlaybackControl& playback, bool is_measuring,
                  ui::HudModel& model) {
  const auto seconds = [](Tick tick) { return static_cast<double>(tick) * 1e-3; };
  model.timeline = ui::HudTimeline{seconds(playback.first_tick()),
                                   seconds(playback.last_tick()),
                                   seconds(playback.position()),
                                   playback.is_playing(),
                                   playback.speed(),
                                   playback.story(),
                                   is_measuring};
}

namespace {

// Looks for what became of one's own last answer in this stage. With a wrong one comes the hint,
// which the server tells later, of a lesson that the programs bring.
void add_verdict(const replica::Replica& replica, ui::HudLesson& shown) {
  const auto& lesson = *replica.told().lesson();
  const auto* own = replica.told().find_participant(replica.own_slot());
  if (own == nullptr || lesson.goal != replica::LessonView::Goal::Find) return;
  const std::string head = own->name + " says that it is here: ";
  for (const auto& notice : replica.told().notices()) {
    if (notice.tick < lesson.begin_tick || !notice.is_for_all || !notice.text.starts_with(head))
      continue;
    shown.is_right = !notice.is_refused;
    shown.verdict = shown.is_right ? "That is right." : "It is not there.";
  }
  if (shown.verdict.empty() || shown.is_right || !shown.hint.empty()) return;
  const auto* known = lesson::find_by_title(lesson.title);
  const auto* stage = known != nullptr ? lesson::find_stage(*known, lesson.name) : nullptr;
  if (stage != nullptr) shown.hint = stage->hint;
}

void add_outcome(const replica::LessonView& lesson, std::optional<float> best_before,
                 ui::HudLesson& shown) {
  const bool has_passed = static_cast<double>(lesson.points) >= lesson::kPassPoints;
  shown.outcome =
      fmt::format("{}: {:.0f} points are needed.",
                  has_passed ? "You have passed" : "Not passed yet", lesson::kPassPoints);
  if (best_before)
    shown.outcome += lesson.points > *best_before
                         ? fmt::format(" Your best so far; it was {:.0f}.", *best_before)
                         : fmt::format(" Your best so far is {:.0f}.", *best_before);
  const auto* known = lesson::find_by_title(lesson.title);
  if (known == nullptr) return;
  std::vector<lesson::ToldResult> results;
  for (const auto& result : lesson.results)
    results.push_back({result.name, result.is_reached, result.lines});
  shown.advice = lesson::advice_on(*known, results);
}

}  // namespace

void add_lesson(const replica::Replica& replica, const render::ImageTexture& image,
                const Onlooker& onlooker, std::optional<float> best_before, ui::HudModel& model) {
  const auto& lesson = replica.told().lesson();
  if (!lesson) return;
  ui::HudLesson shown{.title = lesson->title,
                      .stage = std::to_string(lesson->stage + 1) + " of " +
                               std::to_string(lesson->stages) + ": " + lesson->name,
                      .text = lesson->text,
                      .hint = lesson->hint,
                      .progress = lesson->progress,
                      .seconds = static_cast<double>(lesson->seconds),
                      .limit_s = static_cast<double>(lesson->limit_s),
                      .force_limit_n = lesson->force_limit_n,
                      .is_too_strong = lesson->is_too_strong,
                      .is_over = lesson->is_over,
                      .points = lesson->points};
  // An answer reaches it at once, or not.
  if (lesson->goal == replica::LessonView::Goal::Find) shown.progress.reset();
  if (onlooker.is_replay) {
    const Tick now = replica.newest() != nullptr ? replica.newest()->tick : 0;
    shown.progress.reset();
    shown.seconds =
        static_cast<double>(now > lesson->begin_tick ? now - lesson->begin_tick : 0) * 1e-3;
  } else {
    shown.can_answer =
        lesson->goal == replica::LessonView::Goal::Find && replica.own_slot().has_tools();
    shown.can_lead = onlooker.role == replica::Role::Instructor;
    shown.can_go_on = onlooker.practises;
    add_verdict(replica, shown);
    if (replica.own_slot().has_tools() && lesson->is_over) add_outcome(*lesson, best_before, shown);
  }
  if (image.name() != 0) {
    shown.picture = image.name();
    shown.picture_aspect = static_cast<float>(image.height()) / static_cast<float>(image.width());
  }
  for (const auto& result : lesson->results) {
    char points[48];
    std::snprintf(points, sizeof points, ": %s, %.0f points",
                  result.is_reached ? "reached" : "not reached",
                  static_cast<double>(result.points));
    shown.results.emplace_back(result.name + points, result.lines);
  }
  model.lesson = std::move(shown);
}

void add_pace(const replica::Replica& replica, bool is_replay, ui::HudModel& model) {
  if (is_replay) return;
  const auto& pace = replica.told().pace();
  model.is_paused = pace.is_paused;
  if (pace.is_paused) {
    model.pace_text = (pace.by.empty() ? "Somebody" : pace.by) + " has paused the session.";
  } else if (pace.rate < 1) {
    model.pace_text = ui::slow_text(pace.rate);
  }
  if (!model.can_mark || !replica.told().has_pace()) return;
  ui::HudConduct conduct{.is_paused = pace.is_paused,
                         .rate = pace.rate,
                         .marks = replica.told().marks(),
                         .hands = {},
                         .own = replica.own_slot()};
  for (const auto& who : replica.told().participants())
    if (!who.tools.empty())
      conduct.hands.push_back(
          {who.slot, who.name, !who.frozen_by.empty(), instruments_of(who.tools)});
  model.conduct = std::move(conduct);
}

}  // namespace trocar::app
