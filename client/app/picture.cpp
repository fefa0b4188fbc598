#include "client/app/picture.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "client/render/drawing_priority.h"
#include "client/replica/client_messages.h"
#include "client/shape/ribbon.h"
#include "client/ui/away_text.h"
#include "client/ui/banner_text.h"
#include "client/ui/rate_text.h"
#include "client/ui/solver_text.h"
#include "common/base/log.h"

namespace trocar::app {
namespace {

constexpr std::uint64_t kHelpNs = 20'000'000'000;  // at the start
constexpr std::uint64_t kViewNs = 100'000'000;     // between two words on where a view is
constexpr shape::Colour kLessonColour{240, 228, 66};
constexpr float kLentTargetMetres = 0.1f;         // before the lens: what others turn about
constexpr float kLineHalfWidth = 0.0009f;         // m, as in a browser
constexpr std::uint64_t kFeltBinNs = 62'500'000;  // 160 of them are 10 s

const replica::Participant* owner_of(const replica::Replica& replica, ToolSlot slot) {
  return replica.find_participant(slot.owner());
}

tool::ToolShape shape_of(const replica::Replica& replica, ToolSlot slot) {
  const auto* owner = owner_of(replica, slot);
  const auto number = static_cast<std::size_t>(slot.number());
  return owner != nullptr && number < owner->tools.size() ? owner->tools[number]
                                                          : tool::ToolShape{};
}

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
      renderer_(*context_),
      hud_(*context_, options.scale),
      shows_help_(options.display == Display::Window),
      overlays_(options.overlays),
      view_(options.view),
      sees_with_(options.sees_with) {
  log::debug("drawing with {}", renderer_.description());
  if (context_->is_software()) {
    const int count = render::yield_to_other_work();
    log::debug("drawing in software: {} threads yield to the tissue, the network and hands", count);
  }
}

void Picture::frame_camera(const replica::Replica& replica) {
  const auto& rest = replica.topology().rest_positions;
  if (rest.empty()) return;
  Vec3f low = rest.front(), high = low;
  for (const Vec3f& p : rest) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  camera_.frame((low + high) * 0.5f, length(high - low) * 0.5f);
  constexpr float kRadians = std::numbers::pi_v<float> / 180;
  camera_.orbit(static_cast<float>(view_.yaw_deg) * kRadians,
                static_cast<float>(view_.pitch_deg) * kRadians);
  camera_.zoom(static_cast<float>(1 / view_.zoom));
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

render::SceneTool Picture::scene_tool(const replica::Replica& replica, const replica::Tool& tool,
                                      Hands& hands) const {
  render::SceneTool shown;
  shown.slot = tool.slot;
  shown.world_from_tool = tool.world_from_proxy;
  shown.hand_position = tool.world_from_tool.position;
  shown.shape = shape_of(replica, tool.slot);
  shown.verb = tool.verb;
  shown.has_claim = tool.has_claim;
  shown.is_silent = tool.is_silent;
  shown.force_n = tool.force_n;
  // A person sees the own hand where it is, not where it was a round trip ago, and the tool as far
  // from it as tissue last kept it.
  const device::MouseTool* mouse = hands.mouse_tool(tool.slot.number());
  // A tool that is held still, or lent, is not where its hand is.
  const auto* own = replica.find_participant(replica.own_slot());
  const bool follows_hand = own == nullptr || (own->frozen_by.empty() &&
                                               (own->lent_tools >> tool.slot.number() & 1u) == 0);
  if (follows_hand && mouse != nullptr && mouse->is_valid() &&
      tool.slot.owner() == replica.own_slot()) {
    const Pose hand = mouse->current().world_from_tool;
    const Vec3f held_back = tool.world_from_proxy.position - tool.world_from_tool.position;
    shown.world_from_tool = {hand.position + held_back, hand.orientation};
    shown.hand_position = hand.position;
    shown.verb = mouse->current().verb;
  }
  return shown;
}

std::vector<render::Hold> Picture::holds(const replica::Replica& replica) {
  if (held_history_ != replica.history_version()) held_.clear();
  held_history_ = replica.history_version();
  std::vector<tool::ToolShape> shapes;
  for (const auto& tool : surface_.tools()) shapes.push_back(shape_of(replica, tool.slot));
  // Kept up to date while hidden too: which tissue a grasp took is seen when it takes it.
  held_.update(surface_.positions(), surface_.tools(), shapes);
  std::vector<render::Hold> holds;
  if (!overlays_.holds) return holds;
  for (const auto& holding : held_.holdings()) holds.push_back({holding.owner, holding.is_grasp});
  return holds;
}

render::SceneView Picture::scene_view(const replica::Replica& replica, Hands& hands,
                                      float seconds) {
  render::SceneView scene;
  scene.seconds = seconds;
  scene.shows_regions = overlays_.regions;
  scene.shows_arrows = overlays_.arrows;
  if (!surface_.is_valid()) return scene;
  scene.topology_version = replica.topology_version();
  scene.rest_positions = replica.topology().rest_positions;
  scene.triangles = replica.topology().triangles;
  scene.is_wound = replica.topology().is_wound;
  scene.positions = surface_.positions();
  scene.regions = surface_.regions();
  scene.blood = surface_.blood();
  const auto& ghost = replica.ghost();
  ghost_.clear();
  if (overlays_.ghost && ghost.epoch == replica.topology().epoch &&
      ghost.offsets.size() == scene.positions.size())
    for (std::size_t i = 0; i < scene.positions.size(); ++i)
      ghost_.push_back(scene.positions[i] + ghost.offsets[i]);
  scene.ghost_positions = ghost_;
  scene.holds = holds(replica);
  for (const replica::Tool& tool : surface_.tools())
    scene.tools.push_back(scene_tool(replica, tool, hands));
  lines_.update(replica, scene.positions);
  drawing_.clear();
  for (const auto& line : lines_.lines()) {
    std::vector<shape::RibbonPoint> points;
    for (const auto& point : line.points) points.push_back({point.position, point.normal});
    shape::add_ribbon(points, kLineHalfWidth, shape::colour_of_pointer(line.participant.value),
                      drawing_);
  }
  scene.drawing = drawing_;
  for (const replica::Pointer& pointer : replica.pointers(last_ns_))
    scene.pointers.push_back(
        {pointer.position_m, shape::colour_of_pointer(pointer.participant.value)});
  if (const auto target = lesson_target(replica))
    scene.pointers.push_back({*target, kLessonColour});
  return scene;
}

void Picture::add_participants(const replica::Replica& replica, bool is_replay,
                               ui::HudModel& model) const {
  model.greatest_force_n = forces_.greatest();
  for (const auto& participant : replica.participants()) {
    ui::HudParticipant shown;
    shown.name = participant.name;
    shown.role = participant.role;
    shown.is_away = participant.is_away;
    shown.is_frozen = !participant.frozen_by.empty();
    shown.is_self = !is_replay && participant.slot == replica.own_slot();
    shown.colour = shape::colour_of_slot(participant.slot.value);
    for (const replica::Tool& tool : surface_.tools()) {
      if (tool.slot.owner() != participant.slot) continue;
      shown.has_tool = true;
      shown.is_silent = tool.is_silent;
      shown.is_inside = shown.is_inside || tool.is_inside;
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
      const auto forces = forces_.forces(participant.slot);
      shown.forces_n.assign(forces.begin(), forces.end());
    }
    model.participants.push_back(std::move(shown));
  }
}

void Picture::add_own_forces(const replica::Replica& replica, ui::HudModel& model) const {
  const auto own = replica.own_slot();
  std::size_t count = 0;
  for (const replica::Tool& tool : surface_.tools()) count += tool.slot.owner() == own;
  for (const replica::Tool& tool : surface_.tools()) {
    if (tool.slot.owner() != own) continue;
    const std::string number = count > 1 ? " " + std::to_string(tool.slot.number() + 1) : "";
    model.own_forces.push_back(
        {"force on your tool" + number, shape::colour_of_slot(own.value), length(tool.force_n)});
  }
  if (count == 0) return;
  const auto forces = forces_.forces(own);
  model.own_peak_n = *std::ranges::max_element(forces);
}

void Picture::observe(const replica::Replica& replica, const Hands& hands, std::uint64_t now_ns) {
  forces_.update(replica);
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

void Picture::add_labels(const replica::Replica& replica, const render::SceneView& scene,
                         ui::HudModel& model) const {
  for (const render::SceneTool& tool : scene.tools) {
    const auto* owner = owner_of(replica, tool.slot);
    const Vec3f collar = tool.world_from_tool.apply({0, 0, tool.shape.radius_m * 7});
    const auto at = camera_.project(collar, context_->size());
    if (owner == nullptr || !at) continue;
    char force[32] = "";
    if (length(tool.force_n) >= render::kMinArrowNewton)
      std::snprintf(force, sizeof force, "  %.2f N", length(tool.force_n));
    model.labels.push_back(
        {at->x, at->y, owner->name + force, shape::colour_of_slot(tool.slot.owner().value)});
  }
  for (const replica::Pointer& pointer : replica.pointers(last_ns_)) {
    const auto* owner = replica.find_participant(pointer.participant);
    const auto at = camera_.project(pointer.position_m, context_->size());
    if (owner == nullptr || !at) continue;
    model.labels.push_back({at->x, at->y, owner->name + " points here",
                            shape::colour_of_pointer(pointer.participant.value)});
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
                                const render::SceneView& scene, Hands& hands,
                                std::uint64_t now_ns) const {
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
  } else if (!surface_.is_valid())
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
    // The state of the newest frame may still be under way; then the one before has it.
    const auto& history = replica.history();
    const bool is_complete = newest->has_state || history.size() < 2;
    model.figures = (is_complete ? *newest : history[history.size() - 2]).figures;
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
  if (overlays_.ghost) model.ghost_text = ui::describe(replica.ghost(), is_replay);
  add_lent_view(replica, is_replay, model);
  add_participants(replica, is_replay, model);
  if (!is_replay) add_own_forces(replica, model);
  add_felt_hands(hands, model);
  add_labels(replica, scene, model);
  add_messages(replica, now_ns, model);
  if (const auto* playback = source.playback()) {
    const auto seconds = [](Tick tick) { return static_cast<double>(tick) * 1e-3; };
    model.timeline = ui::HudTimeline{seconds(playback->first_tick()),
                                     seconds(playback->last_tick()),
                                     seconds(playback->position()),
                                     playback->is_playing(),
                                     playback->speed(),
                                     playback->story()};
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
  if (actions.toggle_ghost) overlays_.ghost = !overlays_.ghost;
  if (actions.reset_camera) frame_camera(replica);
  if (actions.screenshot) wants_screenshot_ = true;
  if (actions.next_lent_view) lent_.next(scene_.tools, source.playback() != nullptr);
  if (actions.toggle_follow) follows_view_ = !follows_view_;
  // A wish that cannot be sent is lost: whoever presses the key asks again.
  if (actions.set_mark) replica::ask_for_mark(source, false);
  if (actions.return_to_mark) replica::ask_for_mark(source, true);
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
    if (input.right || input.middle) lent_.leave();
    if (last_ns_ - view_sent_ns_ < kViewNs || !is_framed_) return;
    view_sent_ns_ = last_ns_;
    const auto view = camera_.rays(context_->size());
    const Vec3f target =
        camera_.lens() ? view.eye + view.forward * kLentTargetMetres : camera_.centre();
    replica::send_view(source, view.eye, target);
    return;
  }
  // Whoever moves the view follows nobody.
  if (input.right || input.middle || (input.control && input.wheel != 0)) {
    follows_view_ = false;
    lent_.leave();
  }
  const auto& led = replica.led_view();
  if (follows_view_ && led) camera_.look(led->eye_m, led->target_m);
}

void Picture::move_mouse_tool(const replica::Replica& replica, Hands& hands,
                              const device::PointerInput& input, float seconds) {
  device::MouseTool* const mouse = hands.mouse_tool();
  if (mouse == nullptr) return;
  const auto view = camera_.rays(context_->size());
  const bool is_own = lent_.slot() && lent_.slot()->owner() == replica.own_slot() &&
                      hands.mouse_tool(lent_.slot()->number()) == mouse;
  if (is_own && camera_.lens() && tool::is_endoscope(mouse->shape().form)) {
    mouse->steer(input, view, seconds);
    return;
  }
  mouse->cease_to_steer();
  mouse->update(input, view, surface_.positions(), replica.topology().triangles, seconds);
}

void Picture::find_lent_view(const replica::Replica& replica, bool is_recording) {
  if (sees_with_.empty()) return;
  for (const auto& shown : scene_.tools) {
    const auto* owner = owner_of(replica, shown.slot);
    if (owner == nullptr || owner->name != sees_with_) continue;
    if (!is_recording && !tool::is_endoscope(shown.shape.form)) continue;
    lent_.choose(shown.slot);
    sees_with_.clear();
    return;
  }
}

void Picture::add_lent_view(const replica::Replica& replica, bool is_replay,
                            ui::HudModel& model) const {
  for (const replica::Tool& tool : surface_.tools())
    model.can_lend_view |= is_replay || tool::is_endoscope(shape_of(replica, tool.slot).form);
  if (!camera_.lens() || !lent_.slot()) return;
  const auto* owner = owner_of(replica, *lent_.slot());
  const std::string name = owner != nullptr ? owner->name : "somebody";
  const bool is_own = !is_replay && lent_.slot()->owner() == replica.own_slot();
  const std::string whose = is_own ? "your endoscope" : "the endoscope of " + name;
  model.lent_text = camera_.lens()->is_endoscope
                        ? "You see through " + whose + ": T goes on, right drag ends that."
                        : "You see from behind the tool of " + name + ": T goes on.";
}

void Picture::ask_for_ghost(replica::SessionSource& source) {
  if (source.playback() != nullptr || overlays_.ghost == has_asked_for_ghost_) return;
  if (replica::ask_for_ghost(source, overlays_.ghost)) has_asked_for_ghost_ = overlays_.ghost;
}

void Picture::draw(const replica::Replica& replica, replica::SessionSource& source, Hands& hands,
                   std::uint64_t now_ns) {
  const float seconds =
      last_ns_ == 0 ? 1e-3f : std::min(static_cast<float>(now_ns - last_ns_) * 1e-9f, 0.25f);
  last_ns_ = now_ns;
  measure(replica, now_ns);
  surface_.update(replica, now_ns);
  observe(replica, hands, now_ns);
  if (surface_.is_valid() && !is_framed_) {
    if (shows_help_) help_until_ns_ = now_ns + kHelpNs;
    frame_camera(replica);
    is_framed_ = true;
  }
  // Whoever uses the tool has read enough, and wants to see the organ.
  const auto* own = hands.mouse_tool();
  const bool acts = own != nullptr && own->current().verb != tool::Verb::None;
  if (help_until_ns_ != 0 && (acts || now_ns > help_until_ns_)) {
    shows_help_ = false;
    help_until_ns_ = 0;
  }
  ask_for_ghost(source);
  context_->poll_events();
  hud_.begin_frame(seconds);
  const device::PointerInput input = hud_.input();
  camera_.update(input, context_->size(), seconds);
  share_view(replica, source, input);
  // A hand that held its own camera and moved as that sees would chase itself.
  if (!lent_.slot() || lent_.slot()->owner() != replica.own_slot())
    hands.set_view(camera_.orientation());
  if (surface_.is_valid()) move_mouse_tool(replica, hands, input, seconds);
  scene_ = scene_view(replica, hands, seconds);
  find_lent_view(replica, source.playback() != nullptr);
  lent_.apply(scene_, camera_, source.playback() != nullptr);
  load_lesson_image(replica);
  const auto actions = hud_.draw(hud_model(replica, source, scene_, hands, now_ns));
  act(actions, replica, source);
  if (actions.take_instrument) hands.take(*actions.take_instrument, source);
  if (actions.answer)
    replica::send_lesson_wish(source, replica::LessonWish::Answer,
                              static_cast<std::uint32_t>(hands.choice().hand));
  if (actions.switch_hand) hands.switch_hand(input, camera_.rays(context_->size()));
  renderer_.draw(scene_, camera_);
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
  scene_.seconds = 0;
  renderer_.draw(scene_, camera_, render::Quality::Best);
  hud_.render();
  return context_->read_image();
}

Status Picture::save(const std::string& file) {
  return render::write_png(image(), file);
}

}  // namespace trocar::app
