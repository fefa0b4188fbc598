// The picture's part about two recordings beside each other, and about what is measured in one or
// both of them.

#include <algorithm>
#include <cstdio>

#include "client/app/hud_content.h"
#include "client/app/picture.h"

namespace trocar::app {
namespace {

std::string stage_text(const replica::Replica& replica) {
  const auto& lesson = replica.told().lesson();
  if (!lesson) return {};
  if (!lesson->is_over)
    return "stage " + std::to_string(lesson->stage + 1) + " of " + std::to_string(lesson->stages) +
           ": " + lesson->name;
  char text[64];
  std::snprintf(text, sizeof text, "the lesson is over: %.0f of 100 points",
                static_cast<double>(lesson->points));
  return text;
}

std::string blood_text(const replica::Replica& replica) {
  const auto* newest = replica.newest();
  if (newest == nullptr || !newest->figures.blood || newest->figures.blood->shed_nl == 0) return {};
  char text[48];
  std::snprintf(text, sizeof text, "blood lost %.1f ml",
                static_cast<double>(newest->figures.blood->shed_nl) * 1e-6);
  return text;
}

}  // namespace

void Picture::stand_beside(const ClientOptions& options, replay::PairedSource& pair,
                           const replica::Replica& second) {
  beside_.reset(
      new Beside{pair, second, Pane(*context_, options.sees_with), options.has_own_views});
  shows_help_ = false;  // it would cover the second one
}

void Picture::lay_out() {
  const render::Size size = context_->size();
  if (!beside_) return pane_.set_region({0, 0, size});
  const int left = size.width / 2;
  pane_.set_region({0, 0, {left, size.height}});
  beside_->pane.set_region({left, 0, {size.width - left, size.height}});
}

void Picture::update_beside(std::uint64_t now_ns) {
  if (beside_) beside_->pane.update(beside_->replica, view_, now_ns);
}

void Picture::observe_beside() {
  if (beside_) beside_->pane.observe(beside_->replica);
}

// One view is of both. With views of their own, each is moved where the pointer is.
void Picture::move_cameras(const replica::Replica& replica, const device::PointerInput& input,
                           float seconds) {
  if (!beside_) return pane_.move_camera(replica, input, seconds);
  const auto& other = beside_->pane;
  if (!input.left && !input.right && !input.middle)
    beside_->is_pointed_at = input.x >= static_cast<float>(other.region().left);
  const bool moves_other = beside_->has_own_view && beside_->is_pointed_at;
  if (moves_other)
    beside_->pane.move_camera(beside_->replica, input, seconds);
  else
    pane_.move_camera(replica, input, seconds);
}

void Picture::make_beside_scene(float seconds) {
  if (!beside_) return;
  if (!beside_->has_own_view && pane_.is_framed() && beside_->pane.is_framed()) {
    beside_->pane.cease_to_aim();
    beside_->pane.camera().stand_as(pane_.camera());
  }
  beside_->pane.make_scene(beside_->replica, {}, {overlays_, seconds, true});
}

void Picture::set_fineness(float share) {
  pane_.set_fineness(share);
  if (beside_) beside_->pane.set_fineness(share);
}

void Picture::draw_panes(render::Quality quality) {
  pane_.draw(quality);
  if (beside_) beside_->pane.draw(quality);
}

void Picture::stand_still() {
  pane_.stand_still();
  if (beside_) beside_->pane.stand_still();
}

void Picture::act_beside(const ui::HudActions& actions) {
  if (!beside_) return;
  if (actions.reset_camera) beside_->pane.frame_camera(beside_->replica, view_);
  if (actions.next_lent_view) beside_->pane.lent().next(beside_->pane.scene().tools, true);
  if (actions.toggle_own_views) beside_->has_own_view = !beside_->has_own_view;
  if (actions.toggle_alignment) {
    using replay::Alignment;
    const bool is_by_stage = beside_->pair.alignment() == Alignment::Stage;
    beside_->pair.align(is_by_stage ? Alignment::Start : Alignment::Stage);
  }
}

void Picture::leave_lent_views() {
  pane_.lent().leave();
  if (beside_) beside_->pane.lent().leave();
}

ui::HudHalf Picture::half(std::size_t number, const Pane& pane,
                          const replica::Replica& replica) const {
  const auto& pair = beside_->pair;
  const auto& recording = pair.half(number);
  const auto place = pair.place(number);
  const auto seconds = [](Tick tick) { return static_cast<double>(tick) * 1e-3; };
  ui::HudHalf half{.name = recording.name(),
                   .organ = replica.topology().organ_name,
                   .seconds = seconds(place.tick),
                   .last_seconds = seconds(recording.last_tick()),
                   .stage = stage_text(replica),
                   .blood = blood_text(replica)};
  half.stopped = pair.why_stopped(number);
  if (!half.stopped.empty())
    half.seconds = seconds(recording.position());
  else if (!pane.surface().is_valid())
    half.notice = "Waiting for the organ ...";
  else if (place.has_ended)
    half.notice = "This recording has ended.";
  else if (place.is_waiting)
    half.notice = "This stage is over here; it waits for the other.";
  half.left = static_cast<float>(pane.region().left);
  half.width = static_cast<float>(pane.region().size.width);
  half.participants = participants_of(replica, pane, true);
  half.labels = pane.labels(replica, true);
  if (is_measuring_) half.ruler = pane.ruler();
  return half;
}

void Picture::add_halves(const replica::Replica& replica, ui::HudModel& model) const {
  if (!beside_) return;
  const auto& pair = beside_->pair;
  ui::HudPair shown;
  shown.halves = {half(0, pane_, replica), half(1, beside_->pane, beside_->replica)};
  shown.is_by_stage = pair.alignment() == replay::Alignment::Stage;
  shown.has_stages = pair.has_stages();
  shown.has_own_views = beside_->has_own_view;
  model.greatest_force_n = std::max(pane_.forces().greatest(), beside_->pane.forces().greatest());
  model.pair = std::move(shown);
  if (!model.is_away) model.status.clear();  // each says so for itself
}

// While somebody measures, the left button does that alone.
void Picture::take_measure(const replica::Replica& replica, device::PointerInput& input) {
  const bool is_click = input.left && !was_left_ && input.is_over_scene;
  was_left_ = input.left;
  if (!is_measuring_) return;
  if (is_click && beside_ && beside_->is_pointed_at)
    beside_->pane.measure_at(beside_->replica,
                             input.x - static_cast<float>(beside_->pane.region().left), input.y);
  else if (is_click)
    pane_.measure_at(replica, input.x, input.y);
  input.left = false;
}

void Picture::toggle_measure() {
  is_measuring_ = !is_measuring_;
  pane_.measured().clear();
  if (beside_) beside_->pane.measured().clear();
}

void Picture::add_measure(ui::HudModel& model) const {
  if (!is_measuring_) return;
  const auto& measured = pane_.measured();
  const auto ruler = pane_.ruler();
  if (beside_)
    model.measure_text = "Measure: click two points on an organ. D or Esc ends that.";
  else if (measured.count() == 0)
    model.measure_text = "Measure: click a point on the organ. D or Esc ends that.";
  else if (measured.count() == 1)
    model.measure_text = "Click the other point.";
  else if (!measured.distance_m())
    model.measure_text = "A measured point has no tissue at this time.";
  else
    model.measure_text = ruler.text + " in a straight line. A click begins anew, D ends that.";
  if (!beside_) model.rulers.push_back(ruler);
}

}  // namespace trocar::app
