#include "client/app/picture.h"

#include <algorithm>
#include <cmath>

#include "client/app/hud_content.h"
#include "client/render/drawing_priority.h"
#include "client/replica/client_messages.h"
#include "common/base/log.h"

namespace trocar::app {
namespace {

constexpr std::uint64_t kHelpNs = 20'000'000'000;  // at the start
constexpr std::uint64_t kViewNs = 100'000'000;     // between two words on where a view is
constexpr float kLentTargetMetres = 0.1f;          // before the lens: what others turn about
constexpr std::uint64_t kFeltBinNs = 62'500'000;   // 160 of them are 10 s

// A wish that cannot be sent is lost: whoever asked asks again.
void lead(const ui::HudActions& actions, replica::SessionSource& source) {
  if (actions.lead) replica::send_lead_wish(source, *actions.lead);
  if (actions.mark_named) replica::ask_for_mark(source, false, *actions.mark_named);
  if (actions.return_to_named) replica::ask_for_mark(source, true, *actions.return_to_named);
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

void Picture::Rate::measure(const replica::ReplicaCounters& counters, std::uint64_t count,
                            std::uint64_t now_ns) {
  const double seconds = static_cast<double>(now_ns - start_ns) * 1e-9;
  if (start_ns != 0 && seconds < 1.0) return;
  if (start_ns != 0) {
    pictures_per_second = static_cast<double>(count - pictures) / seconds;
    frames_per_second = static_cast<double>(counters.frames - frames) / seconds;
    bytes_per_second = static_cast<double>(counters.bytes - bytes) / seconds;
  }
  start_ns = now_ns;
  pictures = count;
  frames = counters.frames;
  bytes = counters.bytes;
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

ui::HudModel Picture::hud_model(const replica::Replica& replica, replica::SessionSource& source,
                                Hands& hands, std::uint64_t now_ns) const {
  ui::HudModel model;
  const Onlooker onlooker{role_, source.playback() != nullptr, lesson_.offers_ways_on};
  add_person(replica, onlooker, shared_view_.follows, model);
  add_connection(source, pane_.surface().is_valid(), model);
  add_figures(replica, source, now_ns, model);
  model.pictures_per_second = rate_.pictures_per_second;
  model.frames_per_second = rate_.frames_per_second;
  model.bytes_per_second = rate_.bytes_per_second;
  add_recording(replica, onlooker.is_replay, model);
  model.shows_help = shows_help_;
  model.can_mark = !onlooker.is_replay && role_ == replica::Role::Instructor;
  model.has_own_tool = hands.mouse_tool() != nullptr;
  model.tray = tray_of(hands.choice());
  add_lesson(replica, lesson_.texture, onlooker, lesson_.best.before(), model);
  add_pace(replica, onlooker.is_replay, model);

  model.shows_regions = overlays_.regions;
  model.shows_holds = overlays_.holds;
  model.shows_arrows = overlays_.arrows;
  model.shows_rate = overlays_.rate;
  add_lent_view(replica, pane_, onlooker.is_replay, model);
  model.greatest_force_n = pane_.forces().greatest();
  model.participants = participants_of(replica, pane_, onlooker.is_replay);
  if (!onlooker.is_replay) add_own_forces(replica, pane_, model);
  add_felt_hands(hands, model);
  model.labels = pane_.labels(replica, onlooker.is_replay || overlays_.rate);
  add_measure(model);
  add_halves(replica, model);
  if (!beside_) add_messages(replica, now_ns, model);
  if (const auto* playback = source.playback()) add_timeline(*playback, is_measuring_, model);
  return model;
}

void Picture::act(const ui::HudActions& actions, const replica::Replica& replica,
                  replica::SessionSource& source) {
  // Esc leaves one thing at a time.
  const bool leaves_help = actions.leave && shows_help_;
  if (actions.toggle_help || leaves_help) {
    shows_help_ = !shows_help_;
    help_until_ns_ = 0;
  }
  if (actions.toggle_regions) overlays_.regions = !overlays_.regions;
  if (actions.toggle_holds) overlays_.holds = !overlays_.holds;
  if (actions.toggle_arrows) overlays_.arrows = !overlays_.arrows;
  if (actions.toggle_rate) overlays_.rate = !overlays_.rate;
  if (actions.reset_camera) pane_.frame_camera(replica, view_);
  if (actions.screenshot) wants_screenshot_ = true;
  if (actions.leave && !leaves_help && !is_measuring_) leave_lent_views();
  if (actions.toggle_measure || (actions.leave && !leaves_help && is_measuring_)) toggle_measure();
  if (actions.next_lent_view) pane_.lent().next(pane_.scene().tools, source.playback() != nullptr);
  if (actions.toggle_follow) shared_view_.follows = !shared_view_.follows;
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
  const auto* own = replica.told().find_participant(replica.own_slot());
  if (own != nullptr && own->leads_view) {
    shared_view_.follows = false;
    if (input.right || input.middle) pane_.lent().leave();
    if (last_ns_ - shared_view_.sent_ns < kViewNs || !pane_.is_framed()) return;
    shared_view_.sent_ns = last_ns_;
    const auto view = pane_.camera().rays(pane_.size());
    const Vec3f target = pane_.camera().lens() ? view.eye + view.forward * kLentTargetMetres
                                               : pane_.camera().centre();
    replica::send_view(source, view.eye, target);
    return;
  }
  // Whoever moves the view follows nobody.
  if (input.right || input.middle || (input.control && input.wheel != 0)) {
    shared_view_.follows = false;
    leave_lent_views();
  }
  const auto& led = replica.told().led_view();
  if (!shared_view_.follows || !led) return;
  pane_.cease_to_aim();
  pane_.camera().look(led->eye_m, led->target_m);
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

void LessonPart::load(const replica::Replica& replica) {
  static const std::string kNone;
  const auto& wanted = replica.told().lesson() && !replica.told().lesson()->is_over
                           ? replica.told().lesson()->picture
                           : kNone;
  if (wanted == file) return;
  file = wanted;
  texture.clear();
  if (file.empty()) return;
  if (const auto loaded = texture.load(file); !loaded)
    log::warn("the lesson's {}", loaded.error().message);
}

void Picture::draw(const replica::Replica& replica, replica::SessionSource& source, Hands& hands,
                   std::uint64_t now_ns) {
  const float seconds =
      last_ns_ == 0 ? 1e-3f : std::min(static_cast<float>(now_ns - last_ns_) * 1e-9f, 0.25f);
  last_ns_ = now_ns;
  rate_.measure(replica.counters(), count_, now_ns);
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
  move_cameras(replica, input, seconds);
  share_view(replica, source, input);
  // A hand that held its own camera and moved as that sees would chase itself.
  if (!pane_.lent().slot() || pane_.lent().slot()->owner() != replica.own_slot())
    hands.set_view(pane_.camera().orientation());
  take_measure(replica, input);
  if (pane_.surface().is_valid()) move_mouse_tool(replica, hands, input, seconds);
  pane_.make_scene(replica, hands, {overlays_, seconds, source.playback() != nullptr});
  make_beside_scene(seconds);
  lesson_.load(replica);
  const auto actions = hud_.draw(hud_model(replica, source, hands, now_ns));
  act(actions, replica, source);
  if (source.playback() == nullptr) lesson_.best.note(replica);
  if (actions.after_lesson) lesson_.wish = actions.after_lesson;
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
