#include "client/app/picture.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "client/render/drawing_priority.h"
#include "client/replica/client_messages.h"
#include "client/ui/away_text.h"
#include "client/ui/banner_text.h"
#include "client/ui/rate_text.h"
#include "common/base/log.h"

namespace trocar::app {
namespace {

constexpr std::uint64_t kHelpNs = 20'000'000'000;  // at the start
constexpr std::uint64_t kViewNs = 100'000'000;     // between two words on where a view is
constexpr float kLentTargetMetres = 0.1f;          // before the lens: what others turn about
constexpr std::uint64_t kFeltBinNs = 62'500'000;   // 160 of them are 10 s

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

}  // namespace

Result<std::unique_ptr<Picture>> Picture::make(const ClientOptions& options,
                                               const std::string& title) {
  auto context = options.display == Display::Window
                     ? render::make_window_context(options.size, title)
                     : render::make_headless_context(options.size);
  if (!context) return context.error();
  return std::unique_ptr<Picture>(new Picture(std::move(*context), options));
}

Picture::Picture(std::unique_ptr<render::GlContext> context, const ClientOptions& options)
    : role_(options.role),
      context_(std::move(context)),
      pane_(*context_, options.sees_with),
      hud_(*context_, options.scale),
      shows_help_(options.display == Display::Window),
      overlays_(options.overlays),
      view_(options.view) {
  log::debug("drawing with {}", pane_.renderer().description());
  if (context_->is_software()) {
    const int count = render::yield_to_other_work();
    log::debug("drawing in software: {} threads yield to the tissue, the network and hands", count);
  }
}

void Picture::measure(const replica::Replica& replica, std::uint64_t now_ns) {
  const auto& counters = replica.counters();
  const double seconds = static_cast<double>(now_ns - rate_.start_ns) * 1e-9;
  if (rate_.start_ns != 0 && seconds < 1.0) return;
  if (rate_.start_ns != 0) {
    rate_.pictures_per_second = static_cast<double>(count_ - rate_.pictures) / seconds;
    rate_.frames_per_second = static_cast<double>(counters.frames - rate_.frames) / seconds;
    rate_.bytes_per_second = static_cast<double>(counters.bytes - rate_.bytes) / seconds;
  }
  rate_.start_ns = now_ns;
  rate_.pictures = count_;
  rate_.frames = counters.frames;
  rate_.bytes = counters.bytes;
}

ui::HudTray tray_of(const Hands::Choice& choice) {
  ui::HudTray tray{.chosen = choice.chosen, .hand = choice.hand, .hands = choice.hands};
  for (const auto& instrument : choice.table) {
    tray.names.push_back(instrument.name);
    tray.texts.push_back(instrument.text);
  }
  return tray;
}

std::vector<ui::HudParticipant> Picture::participants_of(const replica::Replica& replica,
                                                         const Pane& pane, bool is_replay) {
  std::vector<ui::HudParticipant> participants;
  const auto waiting = figures_of(replica).pace.rate.waiting_tools;
  for (const auto& participant : replica.participants()) {
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

void Picture::add_own_forces(const replica::Replica& replica, ui::HudModel& model) const {
  const auto own = replica.own_slot();
  std::size_t count = 0;
  for (const replica::Tool& tool : pane_.surface().tools()) count += tool.slot.owner() == own;
  for (const replica::Tool& tool : pane_.surface().tools()) {
    if (tool.slot.owner() != own) continue;
    const std::string number = count > 1 ? " " + std::to_string(tool.slot.number() + 1) : "";
    model.own_forces.push_back(
        {"force on your tool" + number, shape::colour_of_slot(own.value), length(tool.force_n)});
  }
  if (count == 0) return;
  const auto forces = pane_.forces().forces(own);
  model.own_peak_n = *std::ranges::max_element(forces);
}

void Picture::observe(const replica::Replica& replica, const Hands& hands, std::uint64_t now_ns) {
  pane_.observe(replica);
  observe_beside();
  const auto felt = hands.figures();
  for (std::size_t i = 0; i < std::min(felt.size(), felt_forces_.size()); ++i) {
    const auto& state = felt[i].state;
    felt_forces_[i].add(now_ns / kFeltBinNs, {static_cast<float>(length(state.hand_force_n)),
                                              static_cast<float>(length(state.server_force_n))});
  }
}

void Picture::add_felt_hands(const Hands& hands, ui::HudModel& model) const {
  const auto all = hands.figures();
  for (std::size_t i = 0; i < std::min(all.size(), felt_forces_.size()); ++i) {
    const auto& felt = all[i];
    const auto& state = felt.state;
    ui::HudFeltHand shown;
    shown.figures = {.device = felt.device,
                     .has_priority = felt.has_priority,
                     .rate_hz = felt.timing.rate_hz,
                     .late_median_us = felt.timing.late_median_us,
                     .late_95_us = felt.timing.late_95_us,
                     .late_99_us = felt.timing.late_99_us,
                     .overruns = felt.timing.overruns,
                     .answer_age_ms = state.patch_age_s * 1e3,
                     .echo_ms = state.answer_s * 1e3,
                     .hand_n = length(state.hand_force_n),
                     .server_n = length(state.server_force_n),
                     .motion_scale = felt.scale.motion,
                     .force_scale = felt.scale.force,
                     .limited = state.limit_counts};
    const auto hand_n = felt_forces_[i].oldest_first(0);
    const auto server_n = felt_forces_[i].oldest_first(1);
    shown.hand_n.assign(hand_n.begin(), hand_n.end());
    shown.server_n.assign(server_n.begin(), server_n.end());
    model.felt_hands.push_back(std::move(shown));
  }
}

void Picture::add_messages(const replica::Replica& replica, std::uint64_t now_ns,
                           ui::HudModel& model) {
  for (const auto& notice : replica.notices()) {
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

ui::HudModel Picture::hud_model(const replica::Replica& replica, replica::SessionSource& source,
                                Hands& hands, std::uint64_t now_ns) const {
  ui::HudModel model;
  const auto* own = replica.find_participant(replica.own_slot());
  const bool is_replay = source.playback() != nullptr;
  model.title = source.name();
  model.own_role = is_replay ? "replay" : replica::name_of(own != nullptr ? own->role : role_);
  if (!is_replay && own != nullptr) model.own_role += ", " + own->name;
  if (!replica.topology().rest_positions.empty())
    model.organ = replica.topology().organ_name + ", " +
                  ui::with_thousands(replica.topology().rest_positions.size()) +
                  " surface vertices";
  if (source.state() == replica::SourceState::Connecting)
    model.status = "Connecting to " + source.name() + " ...";
  else if (source.state() == replica::SourceState::Away) {
    model.status = ui::describe_absence(source.statistics().away_seconds,
                                        source.statistics().away_left_seconds);
    model.status_advice = "Wait. If it lasts, check the network of this computer.";
  } else if (source.state() == replica::SourceState::Closed) {
    model.status = source.close_reason().text;
    model.status_advice = ui::advice_after(source.close_reason().kind);
  } else if (!pane_.surface().is_valid())
    model.status = "Waiting for the organ ...";
  if (own != nullptr && !own->frozen_by.empty())
    model.frozen_text = own->frozen_by + " keeps your tools where they are.";
  model.has_loan = own != nullptr && own->lent_tools != 0;
  const auto& people = replica.participants();
  const auto leader = std::ranges::find_if(people, &replica::Participant::leads_view);
  if (leader != people.end() && leader->slot == replica.own_slot())
    model.view_text = "Others may follow your view.";
  else if (leader != people.end())
    model.view_text = follows_view_ ? "You follow the view of " + leader->name + ": V ends that."
                                    : "V follows the view of " + leader->name + ".";
  model.is_away = source.state() == replica::SourceState::Away ||
                  source.state() == replica::SourceState::Closed;
  if (const auto* newest = replica.newest()) {
    model.figures = figures_of(replica);
    model.session_seconds = static_cast<double>(newest->tick) * 1e-3;
  }
  const auto statistics = source.statistics();
  model.round_trip_ms = statistics.round_trip_seconds * 1e3;
  if (statistics.has_server_clock)
    model.surface_age_ms =
        replica.age_ms(static_cast<double>(now_ns) * 1e-3 + statistics.server_offset_us);
  model.pictures_per_second = rate_.pictures_per_second;
  model.frames_per_second = rate_.frames_per_second;
  model.bytes_per_second = rate_.bytes_per_second;
  using Status = wire::RecordingStatus;
  const auto recorded = replica.recording().status;
  if (!is_replay && recorded != Status::Unknown)
    model.is_recorded = recorded == Status::Whole || recorded == Status::Gapped;
  model.recording_text = replica.recording().text;
  model.has_recording_ended = recorded == Status::Failed;
  model.sync_text = model.is_away ? "old" : sync_text(replica);
  model.is_in_step = !model.is_away && replica.sync_state() == replica::SyncState::InStep;
  model.shows_regions = overlays_.regions;
  model.shows_help = shows_help_;
  model.can_mark = source.playback() == nullptr && role_ == replica::Role::Instructor;
  model.has_own_tool = hands.mouse_tool() != nullptr;
  model.tray = tray_of(hands.choice());
  add_lesson(replica, is_replay, model);
  add_pace(replica, is_replay, model);

  model.shows_holds = overlays_.holds;
  model.shows_arrows = overlays_.arrows;
  model.shows_rate = overlays_.rate;
  add_lent_view(replica, is_replay, model);
  model.greatest_force_n = pane_.forces().greatest();
  model.participants = participants_of(replica, pane_, is_replay);
  if (!is_replay) add_own_forces(replica, model);
  add_felt_hands(hands, model);
  model.labels = pane_.labels(replica);
  add_measure(model);
  add_halves(replica, model);
  if (!beside_) add_messages(replica, now_ns, model);
  if (const auto* playback = source.playback()) {
    const auto seconds = [](Tick tick) { return static_cast<double>(tick) * 1e-3; };
    model.timeline = ui::HudTimeline{seconds(playback->first_tick()),
                                     seconds(playback->last_tick()),
                                     seconds(playback->position()),
                                     playback->is_playing(),
                                     playback->speed(),
                                     playback->story(),
                                     is_measuring_};
  }
  return model;
}

void Picture::act(const ui::HudActions& actions, const replica::Replica& replica,
                  replica::SessionSource& source) {
  if (actions.toggle_help) {
    shows_help_ = !shows_help_;
    help_until_ns_ = 0;
  }
  if (actions.toggle_regions) overlays_.regions = !overlays_.regions;
  if (actions.toggle_holds) overlays_.holds = !overlays_.holds;
  if (actions.toggle_arrows) overlays_.arrows = !overlays_.arrows;
  if (actions.toggle_rate) overlays_.rate = !overlays_.rate;
  if (actions.reset_camera) pane_.frame_camera(replica, view_);
  if (actions.screenshot) wants_screenshot_ = true;
  if (actions.toggle_measure || (actions.end_measure && is_measuring_)) toggle_measure();
  if (actions.next_lent_view) pane_.lent().next(pane_.scene().tools, source.playback() != nullptr);
  if (actions.toggle_follow) follows_view_ = !follows_view_;
  // A wish that cannot be sent is lost: whoever presses the key asks again.
  if (actions.set_mark) replica::ask_for_mark(source, false);
  if (actions.return_to_mark) replica::ask_for_mark(source, true);
  act_beside(actions);
  lead(actions, source);
  if (actions.next_stage) replica::send_lesson_wish(source, replica::LessonWish::Next);
  if (actions.restart_lesson) replica::send_lesson_wish(source, replica::LessonWish::Restart);
  replica::PlaybackControl* playback = source.playback();
  if (playback == nullptr) return;
  if (actions.toggle_play) playback->is_playing() ? playback->pause() : playback->play();
  if (actions.pause) playback->pause();
  if (actions.speed) playback->set_speed(*actions.speed);
  if (actions.seek_seconds)
    playback->seek(static_cast<Tick>(std::llround(std::max(0.0, *actions.seek_seconds) * 1e3)));
}

void Picture::share_view(const replica::Replica& replica, replica::SessionSource& source,
                         const device::PointerInput& input) {
  const auto* own = replica.find_participant(replica.own_slot());
  if (own != nullptr && own->leads_view) {
    follows_view_ = false;
    if (input.right || input.middle) pane_.lent().leave();
    if (last_ns_ - view_sent_ns_ < kViewNs || !pane_.is_framed()) return;
    view_sent_ns_ = last_ns_;
    const auto view = pane_.camera().rays(pane_.size());
    const Vec3f target = pane_.camera().lens() ? view.eye + view.forward * kLentTargetMetres
                                               : pane_.camera().centre();
    replica::send_view(source, view.eye, target);
    return;
  }
  // Whoever moves the view follows nobody.
  if (input.right || input.middle || (input.control && input.wheel != 0)) {
    follows_view_ = false;
    leave_lent_views();
  }
  const auto& led = replica.led_view();
  if (follows_view_ && led) pane_.camera().look(led->eye_m, led->target_m);
}

void Picture::move_mouse_tool(const replica::Replica& replica, Hands& hands,
                              const device::PointerInput& input, float seconds) {
  device::MouseTool* const mouse = hands.mouse_tool();
  if (mouse == nullptr) return;
  const auto view = pane_.camera().rays(pane_.size());
  const bool is_own = pane_.lent().slot() && pane_.lent().slot()->owner() == replica.own_slot() &&
                      hands.mouse_tool(pane_.lent().slot()->number()) == mouse;
  if (is_own && pane_.camera().lens() && tool::is_endoscope(mouse->shape().form)) {
    mouse->steer(input, view, seconds);
    return;
  }
  mouse->cease_to_steer();
  mouse->update(input, view, pane_.surface().positions(), replica.topology().triangles, seconds);
}

void Picture::add_lent_view(const replica::Replica& replica, bool is_replay,
                            ui::HudModel& model) const {
  for (const replica::Tool& tool : pane_.surface().tools())
    model.can_lend_view |= is_replay || tool::is_endoscope(shape_of(replica, tool.slot).form);
  if (!pane_.camera().lens() || !pane_.lent().slot()) return;
  const auto* owner = owner_of(replica, *pane_.lent().slot());
  const std::string name = owner != nullptr ? owner->name : "somebody";
  const bool is_own = !is_replay && pane_.lent().slot()->owner() == replica.own_slot();
  const std::string whose = is_own ? "your endoscope" : "the endoscope of " + name;
  model.lent_text = pane_.camera().lens()->is_endoscope
                        ? "You see through " + whose + ": T goes on, right drag ends that."
                        : "You see from behind the tool of " + name + ": T goes on.";
}

void Picture::draw(const replica::Replica& replica, replica::SessionSource& source, Hands& hands,
                   std::uint64_t now_ns) {
  const float seconds =
      last_ns_ == 0 ? 1e-3f : std::min(static_cast<float>(now_ns - last_ns_) * 1e-9f, 0.25f);
  last_ns_ = now_ns;
  measure(replica, now_ns);
  observe(replica, hands, now_ns);
  lay_out();
  update_beside(now_ns);
  if (pane_.update(replica, view_, now_ns) && shows_help_) help_until_ns_ = now_ns + kHelpNs;
  // Whoever uses the tool has read enough, and wants to see the organ.
  const auto* own = hands.mouse_tool();
  const bool acts = own != nullptr && own->current().verb != tool::Verb::None;
  if (help_until_ns_ != 0 && (acts || now_ns > help_until_ns_)) {
    shows_help_ = false;
    help_until_ns_ = 0;
  }
  context_->poll_events();
  hud_.begin_frame(seconds);
  device::PointerInput input = hud_.input();
  move_cameras(input, seconds);
  share_view(replica, source, input);
  // A hand that held its own camera and moved as that sees would chase itself.
  if (!pane_.lent().slot() || pane_.lent().slot()->owner() != replica.own_slot())
    hands.set_view(pane_.camera().orientation());
  take_measure(replica, input);
  if (pane_.surface().is_valid()) move_mouse_tool(replica, hands, input, seconds);
  pane_.make_scene(replica, hands, {overlays_, seconds, source.playback() != nullptr});
  make_beside_scene(seconds);
  load_lesson_image(replica);
  const auto actions = hud_.draw(hud_model(replica, source, hands, now_ns));
  act(actions, replica, source);
  if (actions.take_instrument) hands.take(*actions.take_instrument, source);
  if (actions.answer)
    replica::send_lesson_wish(source, replica::LessonWish::Answer,
                              static_cast<std::uint32_t>(hands.choice().hand));
  if (actions.switch_hand) hands.switch_hand(input, pane_.camera().rays(pane_.size()));
  draw_panes(render::Quality::Live);
  hud_.render();
  if (wants_screenshot_ && !saving_.is_busy()) {
    wants_screenshot_ = false;
    const std::string file = "trocar-" + std::to_string(now_ns / 1'000'000) + ".png";
    // Hands would fall silent meanwhile.
    saving_.start([image = image(), file] {
      if (const auto saved = render::write_png(image, file); !saved)
        log::warn("{}", saved.error().message);
      else
        log::info("screenshot: {}", file);
    });
  }
  context_->present();
  ++count_;
}

render::Image Picture::image() {
  stand_still();
  draw_panes(render::Quality::Best);
  hud_.render();
  return context_->read_image();
}

Status Picture::save(const std::string& file) {
  return render::write_png(image(), file);
}

}  // namespace trocar::app
