#include "server/tissue/cutting/cutter.h"

#include <algorithm>
#include <numeric>

namespace trocar::cutting {
namespace {

// A stroke that is served may make this part of a call's edits, however many wait: fewer would
// hardly pay for looking at where it is.
constexpr std::uint32_t kMostServedInFull = 4;

}  // namespace

Cutter::Cutter(topology::Topology& topology, const Settings& settings)
    : strokes_(kMaxStrokes),
      mesh_(topology, settings, strokes_),
      splitter_(settings.make_splitter ? settings.make_splitter() : std::make_unique<Splitter>()),
      edits_left_(settings.edits_per_call) {
  stroke_of_.fill(kNone);
}

// None where too much is planned: this blade is too fast to cut.
Stroke* Cutter::begin_stroke(std::uint32_t blade) {
  std::size_t planned = 0;
  for (const auto& stroke : strokes_) planned += stroke.is_active ? stroke.motion.strips() : 0;
  if (planned >= mesh_.settings().most_pieces_planned) return nullptr;
  for (std::uint32_t s = 0; s < strokes_.size(); ++s) {
    if (strokes_[s].is_active) continue;
    auto& stroke = strokes_[s];
    stroke.is_active = true;
    stroke.id = next_id_++;
    stroke.h = mesh_.mean_h();
    stroke_of_[blade] = s;
    return &stroke;
  }
  return nullptr;
}

bool Cutter::move(std::uint32_t blade, std::span<const Vec3d> edge) {
  if (blade >= kMaxBlades || !is_blade(edge)) return false;
  if (stroke_of_[blade] != kNone) {
    auto& stroke = strokes_[stroke_of_[blade]];
    if (stroke.motion.move(edge, stroke.h, mesh_.settings()) == BladeMotion::Verdict::Accepted)
      return true;
    lift(blade);
  }
  auto* const stroke = begin_stroke(blade);
  if (stroke == nullptr) return false;
  return stroke->motion.move(edge, stroke->h, mesh_.settings()) == BladeMotion::Verdict::Accepted;
}

void Cutter::lift(std::uint32_t blade) {
  if (blade >= kMaxBlades || stroke_of_[blade] == kNone) return;
  auto& stroke = strokes_[stroke_of_[blade]];
  stroke.motion.finish(stroke.h, mesh_.settings());
  stroke.has_ended = true;
  stroke_of_[blade] = kNone;
}

void Cutter::carry(std::uint32_t blade, const std::array<Vec3d, 2>& moved) {
  if (blade < kMaxBlades && stroke_of_[blade] != kNone)
    strokes_[stroke_of_[blade]].motion.carry(moved);
}

bool Cutter::is_idle() const {
  return torn_.empty() && std::ranges::none_of(strokes_, [](const Stroke& stroke) {
           return stroke.is_active && (stroke.has_ended || stroke.motion.has_strip());
         });
}

double Cutter::behind_m(std::uint32_t blade) const {
  if (blade >= kMaxBlades || stroke_of_[blade] == kNone) return 0;
  return strokes_[stroke_of_[blade]].motion.behind();
}

Status Cutter::repeat(const CutEvents& events, std::vector<topology::NewNode>& made) {
  if (std::ranges::any_of(strokes_, &Stroke::is_active))
    return Error{ErrorCode::Refused, "cut events cannot be repeated while a blade cuts"};
  return mesh_.repeat(events, made);
}

void Cutter::clear_strokes() {
  for (auto& stroke : strokes_) stroke.clear();
  stroke_of_.fill(kNone);
  next_id_ = 0;
  edits_left_ = mesh_.settings().edits_per_call;
  is_resting_ = false;
}

double Cutter::h_at(std::uint32_t blade) const {
  if (blade >= kMaxBlades || stroke_of_[blade] == kNone) return mesh_.mean_h();
  return strokes_[stroke_of_[blade]].h;
}

std::uint32_t Cutter::blade_of(std::uint32_t place) const {
  return static_cast<std::uint32_t>(std::ranges::find(stroke_of_, place) - stroke_of_.begin());
}

// Strokes in their order, each with its blade, or kMaxBlades for one that has ended. Their places
// and numbers change nothing.
void Cutter::visit_state(world::StateArchive& archive) {
  order_.clear();
  for (std::uint32_t s = 0; s < strokes_.size(); ++s)
    if (strokes_[s].is_active) order_.push_back(s);
  order_strokes();
  auto count = static_cast<std::uint8_t>(order_.size());
  archive.value(count);
  if (archive.is_reading()) {
    clear_strokes();
    mesh_.forget_places();
    if (count > kMaxStrokes) archive.fail();
    order_.resize(archive.ok() ? count : 0);
    std::iota(order_.begin(), order_.end(), 0u);
  }
  for (const auto s : order_) visit_stroke(archive, s);
  archive.value(edits_left_);
  archive.flag(is_resting_);
  if (archive.is_reading() && edits_left_ > mesh_.settings().edits_per_call) archive.fail();
  if (!archive.ok()) clear_strokes();
}

void Cutter::visit_stroke(world::StateArchive& archive, std::uint32_t place) {
  auto& stroke = strokes_[place];
  auto blade = static_cast<std::uint8_t>(blade_of(place));
  archive.value(blade);
  if (archive.is_reading()) {
    if (blade > kMaxBlades || (blade < kMaxBlades && stroke_of_[blade] != kNone)) archive.fail();
    if (!archive.ok()) return;
    stroke.id = next_id_++;
    stroke.is_active = true;
    stroke.has_ended = blade == kMaxBlades;
    if (!stroke.has_ended) stroke_of_[blade] = place;
  }
  stroke.visit_state(archive, mesh_.topology());
}

void Cutter::order_strokes() {
  std::sort(order_.begin(), order_.end(),
            [&](auto a, auto b) { return strokes_[a].id < strokes_[b].id; });
}

void Cutter::cut(std::span<const Vec3f> displacements, CutOutput& out, double travel_m) {
  out.clear();
  refill();
  if (is_idle()) return;
  mesh_.begin(displacements, travel_m, out);
  if (!torn_.empty()) {
    opening_.open(mesh_, torn_);
    torn_.clear();
    out.torn_area_m2 = out.opened_area_m2;
  }
  order_.clear();
  for (std::uint32_t s = 0; s < strokes_.size(); ++s)
    if (strokes_[s].is_active && (strokes_[s].has_ended || strokes_[s].motion.has_strip()))
      order_.push_back(s);
  order_strokes();
  std::size_t served = 0;
  for (; served < order_.size() && edits_left_ > 0 && !is_resting_; ++served) {
    const auto waiting = static_cast<std::uint32_t>(order_.size() - served);
    const auto share =
        std::max({1u, edits_left_ / waiting, mesh_.settings().edits_per_call / kMostServedInFull});
    edits_left_ -= std::min(edits_left_, serve(order_[served], share));
  }
  is_resting_ |= edits_left_ == 0;
  if (served < order_.size()) {
    out.is_behind = true;
    let_others_go_first(std::span(order_).first(served));
  }
  mesh_.end();
}

void Cutter::refill() {
  const auto most = mesh_.settings().edits_per_call;
  edits_left_ = std::min(most, edits_left_ + mesh_.settings().edits_in_the_mean);
  if (2 * edits_left_ >= most) is_resting_ = false;
}

// Returns what it took of its share.
std::uint32_t Cutter::serve(std::uint32_t place, std::uint32_t share) {
  auto& stroke = strokes_[place];
  auto& out = mesh_.out();
  auto budget = share;
  const double work_before = out.work_j;
  const bool is_done = work(stroke, budget);
  if (const auto blade = blade_of(place); blade < kMaxBlades)
    out.blade_work_j[blade] += out.work_j - work_before;
  const bool has_cut = budget < share;
  // A stroke is ended only in a call that finds nothing of it to cut.
  if (!has_cut && stroke.has_ended) {
    budget -= std::min(budget, static_cast<std::uint32_t>(stroke.waiting.size()));
    out.is_behind |= !is_done || !end(stroke);
  } else {
    out.is_behind |= !is_done || stroke.has_ended;
  }
  return share - budget;
}

void Cutter::let_others_go_first(std::span<const std::uint32_t> places) {
  for (const auto s : places)
    if (strokes_[s].is_active) strokes_[s].id = next_id_++;
}

EdgeResistance Cutter::resistance_of(std::span<const Vec3f> displacements,
                                     std::span<const Vec3f> velocities, double travel_m,
                                     const Vec3d& from, const Vec3d& to) {
  mesh_.begin(displacements, travel_m, unchanged_);
  const auto resistance = meter_.measure(mesh_, velocities, from, to);
  mesh_.end();
  return resistance;
}

// Returns whether nothing is left.
bool Cutter::work(Stroke& stroke, std::uint32_t& budget) {
  while (stroke.motion.has_strip()) {
    if (budget == 0) return false;
    for (const bool is_extended : {false, true}) {
      stroke.sides = stroke.sides_before;
      make_patch(stroke.motion.strip(), is_extended ? mesh_.settings().extension_h * stroke.h : 0,
                 mesh_.settings().least_turn_h * stroke.h, stroke.sides,
                 is_extended ? stroke.patch : stroke.path);
    }
    const bool is_finished = splitter_->run(mesh_, stroke, stroke.patch, budget);
    opening_.run(mesh_, stroke);
    if (!is_finished) return false;
    stroke.sides_before = stroke.sides;
    stroke.way += longest_motion(stroke.motion.strip().from, stroke.motion.strip().to);
    stroke.motion.pop();
    if (stroke.way > mesh_.settings().repair_h * stroke.h) {
      stroke.way = 0;
      if (!stroke.waiting.empty()) repair_.run_behind(mesh_, stroke, opening_);
    }
    forget(stroke);
  }
  return true;
}

// Returns whether the stroke is over.
bool Cutter::end(Stroke& stroke) {
  if (stroke.repairs == 0 && side_cut_.run(mesh_, stroke, opening_)) opening_.run(mesh_, stroke);
  if (!repair_.finish(mesh_, stroke, opening_)) return false;
  mesh_.out().waiting_area_m2 += opening_.waiting_area(mesh_, stroke);
  stroke.clear();
  return true;
}

void Cutter::forget(Stroke& stroke) {
  kept_.clear();
  for (const auto t : stroke.waiting)
    for (const auto node : mesh_.topology().tet(t)) kept_.push_back(node);
  std::sort(kept_.begin(), kept_.end());
  const double range = mesh_.settings().forget_h * stroke.h;
  const auto is_far = [&](NodeIndex node) {
    const auto p = mesh_.position(node);
    return std::ranges::none_of(stroke.patch,
                                [&](const PatchTriangle& triangle) {
                                  return std::abs(signed_distance(triangle, p)) <= range &&
                                         is_inside(triangle, p, range);
                                }) &&
           !std::binary_search(kept_.begin(), kept_.end(), node);
  };
  stroke.forget_if(is_far, mesh_.topology());
}

}  // namespace trocar::cutting
