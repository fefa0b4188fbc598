#include "common/lesson/course.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "common/lesson/loose_piece.h"

namespace trocar::lesson {
namespace {

constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();
constexpr double kJumpM = 0.05;     // from one frame to the next: a tool that came back
constexpr double kTouchM = 0.015;   // from the surface: an answer there means the tissue
constexpr double kCovered = 0.9;    // of a line that counts as cut
constexpr Tick kWoundPeriod = 250;  // ticks between two looks at the wound
constexpr double kFeltN = 0.05;     // less is not a touch
constexpr double kInHandM = 0.015;  // from a grasping tip to the piece that it holds

double seconds_of(Tick ticks) {
  return static_cast<double>(ticks) / static_cast<double>(kTicksPerSecond);
}

Vec3d along(std::span<const Vec3d> line, double way) {
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const double span = length(line[i + 1] - line[i]);
    if (way < span) return line[i] + (line[i + 1] - line[i]) * (way / span);
    way -= span;
  }
  return line.back();
}

double way_of(std::span<const Vec3d> line) {
  double way = 0;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) way += length(line[i + 1] - line[i]);
  return way;
}

}  // namespace

// A meter sums up what happens in the stage that is on.
struct Course::Meter {
  std::map<ToolSlot, Vec3d> tips;     // in the frame before
  std::map<ToolSlot, Vec3d> grasped;  // where tools that hold took hold
  double peak_n = 0, touched_ns = 0, touched_s = 0, above_s = 0, path_m = 0;
  double held_s = 0;
  double off_ms = 0, off_s = 0;  // integral of the distance from the point, and over which time
  double wrong = 0, refusals = 0;
  double answer_error_m = kNotMeasured;
  std::optional<double> blood_before_m3, blood_m3;  // lost before the stage, and so far
  // The wound.
  bool is_looked_at = false;
  std::uint32_t epoch = 0;
  Tick tick = 0;
  std::size_t triangles = 0;
  Incision incision;
  std::optional<Specimen> specimen;
  double harm_m2 = 0;
  // The loose piece.
  std::optional<std::uint32_t> piece_epoch;
  std::vector<TriangleIndex> piece;
  bool is_in_hand = false;
  int most_hands = 0;  // that held it at the same time
  double drops = 0, off_m = kNotMeasured;
};

std::vector<std::string> lines_of(const StageResult& result) {
  std::vector<std::string> lines;
  for (int i = 0; i < kMeasures; ++i) {
    const auto measure = static_cast<Measure>(i);
    const double value = result.value(measure);
    if (!std::isnan(value))
      lines.push_back(std::string(words_of(measure)) + ": " + text_of(measure, value));
  }
  return lines;
}

Course::Course(Lesson lesson) : lesson_(std::move(lesson)), meter_(std::make_unique<Meter>()) {}
Course::~Course() = default;
Course::Course(Course&&) noexcept = default;
Course& Course::operator=(Course&&) noexcept = default;

std::size_t Course::stage_number() const {
  return std::min(results_.size(), lesson_.stages.size() - 1);
}

double Course::seconds() const {
  return tick_ ? seconds_of(*tick_ - begin_) : 0;
}

double Course::harm_m2() const {
  return meter_->harm_m2;
}

bool Course::shows_hint() const {
  return !is_over() && !stage().hint.empty() && seconds() >= stage().hint_after_s;
}

std::optional<Vec3d> Course::target_m() const {
  if (is_over()) return std::nullopt;
  if (stage().goal == Goal::Carry) return stage().line_m.back();
  if (stage().goal != Goal::Follow) return std::nullopt;
  // The point goes there and back in one lap.
  const double part = std::fmod(seconds() / stage().lap_s, 1.0);
  const double way = way_of(stage().line_m) * (part < 0.5 ? 2 * part : 2 - 2 * part);
  return along(stage().line_m, way);
}

double Course::points() const {
  if (results_.empty()) return 0;
  return std::accumulate(results_.begin(), results_.end(), 0.0,
                         [](double sum, const auto& result) { return sum + result.points; }) /
         static_cast<double>(results_.size());
}

void Course::begin_stage(Tick tick) {
  begin_ = tick;
  progress_ = 0;
  is_too_strong_ = false;
  auto tips = std::move(meter_->tips);
  const auto blood_m3 = meter_->blood_m3;
  *meter_ = Meter{};
  meter_->tips = std::move(tips);
  meter_->blood_before_m3 = meter_->blood_m3 = blood_m3;
}

void Course::restart() {
  results_.clear();
  begin_stage(tick_.value_or(0));
}

void Course::skip() {
  if (!is_over()) end_stage(false);
}

void Course::note_refusal() {
  if (!is_over()) meter_->refusals += 1;
}

void Course::end_stage(bool is_reached) {
  const auto& meter = *meter_;
  const auto& stage = this->stage();
  StageResult result{.is_reached = is_reached, .begin = begin_, .end = tick_.value_or(begin_)};
  result.values.fill(kNotMeasured);
  const auto set = [&](Measure measure, double value) {
    result.values[static_cast<std::size_t>(measure)] = value;
  };
  set(Measure::Time, seconds());
  set(Measure::PeakForce, meter.peak_n);
  if (meter.touched_s > 0) set(Measure::MeanForce, meter.touched_ns / meter.touched_s);
  if (stage.force_limit_n > 0) set(Measure::TimeAbove, meter.above_s);
  set(Measure::Path, meter.path_m);
  set(Measure::Refusals, meter.refusals);
  // A return to the instructor's mark gives blood back.
  if (meter.blood_m3) set(Measure::Blood, std::max(0.0, *meter.blood_m3 - *meter.blood_before_m3));
  if (stage.goal == Goal::Find) {
    set(Measure::WrongAnswers, meter.wrong);
    set(Measure::Error, meter.answer_error_m);
  }
  if (stage.goal == Goal::Follow && meter.off_s > 0)
    set(Measure::Error, meter.off_ms / meter.off_s);
  if (stage.goal == Goal::Carry) {
    set(Measure::Error, meter.off_m);
    set(Measure::Drops, meter.drops);
  }
  if (stage.goal == Goal::Incise) {
    set(Measure::Error, meter.incision.error_m);
    set(Measure::StrayWound, meter.incision.stray_m2);
  }
  if (!stage.spare.empty()) set(Measure::Harm, meter.harm_m2);
  if (meter.specimen) {
    set(Measure::Volume, meter.specimen->volume_m3);
    set(Measure::MissingMargin, std::max(0.0, stage.margin_m - meter.specimen->margin_m));
  }
  // A score brings no points for what was not measured.
  if (is_reached) {
    double sum = 0;
    for (const auto& score : stage.scores) {
      const double value = result.value(score.measure);
      if (!std::isnan(value)) sum += score.points(value);
    }
    result.points =
        stage.scores.empty() ? 100 : 100 * sum / static_cast<double>(stage.scores.size());
  }
  results_.push_back(result);
  begin_stage(tick_.value_or(begin_));
  if (is_over()) progress_ = 1;
}

void Course::measure(const Moment& moment, double dt_s) {
  auto& meter = *meter_;
  double strongest = 0;
  std::map<ToolSlot, Vec3d> tips;
  for (const auto& tip : moment.tips) {
    strongest = std::max(strongest, tip.force_n);
    if (const auto before = meter.tips.find(tip.tool); before != meter.tips.end()) {
      const double way = length(tip.position_m - before->second);
      if (way < kJumpM) meter.path_m += way;
    }
    tips[tip.tool] = tip.position_m;
  }
  meter.tips = std::move(tips);
  meter.peak_n = std::max(meter.peak_n, strongest);
  meter.blood_m3 = moment.blood_m3;
  if (!meter.blood_before_m3) meter.blood_before_m3 = moment.blood_m3;
  if (strongest > kFeltN) meter.touched_ns += strongest * dt_s, meter.touched_s += dt_s;
  is_too_strong_ = stage().force_limit_n > 0 && strongest > stage().force_limit_n;
  if (is_too_strong_) meter.above_s += dt_s;
}

// A look costs as much as the surface is large, so that it is not done in every frame of a cut.
void Course::look_at_wound(const Moment& moment) {
  auto& meter = *meter_;
  const auto& layout = *moment.layout;
  const bool is_same = meter.is_looked_at && layout.epoch == meter.epoch &&
                       layout.triangles.size() == meter.triangles;
  if (is_same || (meter.is_looked_at && moment.tick - meter.tick < kWoundPeriod)) return;
  meter.is_looked_at = true;
  meter.epoch = layout.epoch, meter.triangles = layout.triangles.size(), meter.tick = moment.tick;
  const auto& stage = this->stage();
  meter.harm_m2 = 0;
  for (const auto& name : stage.spare)
    meter.harm_m2 += wound_within_m2(layout, *lesson_.find_structure(name));
  if (stage.goal == Goal::Incise)
    meter.incision = measure_incision(layout, stage.line_m, stage.depth_m, stage.tolerance_m);
  if (stage.goal == Goal::Remove)
    meter.specimen = find_specimen(layout, *lesson_.find_structure(stage.structure));
}

bool Course::follows(const Moment& moment, double dt_s) {
  auto& meter = *meter_;
  const auto target = *target_m();
  double nearest = std::numeric_limits<double>::max();
  for (const auto& tip : moment.tips) nearest = std::min(nearest, length(tip.position_m - target));
  if (nearest <= stage().tolerance_m) meter.held_s += dt_s;
  // The way to the point does not count.
  if (meter.held_s > 0 && !moment.tips.empty()) meter.off_ms += nearest * dt_s, meter.off_s += dt_s;
  progress_ = std::min(1.0, meter.held_s / stage().hold_s);
  return meter.held_s >= stage().hold_s;
}

bool Course::lifts(const Moment& moment, double dt_s) {
  auto& meter = *meter_;
  double farthest = 0;
  std::map<ToolSlot, Vec3d> grasped;
  for (const auto& tip : moment.tips) {
    if (tip.verb != tool::Verb::Grasp || !tip.has_claim) continue;
    const auto before = meter.grasped.find(tip.tool);
    const auto from = before == meter.grasped.end() ? tip.position_m : before->second;
    grasped[tip.tool] = from;
    farthest = std::max(farthest, length(tip.position_m - from));
  }
  meter.grasped = std::move(grasped);
  meter.held_s = farthest >= stage().lift_m ? meter.held_s + dt_s : 0;
  progress_ = std::min(
      1.0, 0.5 * std::min(1.0, farthest / stage().lift_m) + 0.5 * meter.held_s / stage().hold_s);
  return meter.held_s >= stage().hold_s;
}

bool Course::holds(const Moment& moment, double dt_s) {
  auto& meter = *meter_;
  const auto holding = std::ranges::count_if(
      moment.tips, [](const Tip& tip) { return tip.verb == tool::Verb::Grasp && tip.has_claim; });
  meter.held_s = holding >= stage().hands ? meter.held_s + dt_s : 0;
  const double hands = std::min(1.0, static_cast<double>(holding) / stage().hands);
  progress_ = std::min(1.0, 0.5 * hands + 0.5 * meter.held_s / stage().hold_s);
  return meter.held_s >= stage().hold_s;
}

bool Course::carries(const Moment& moment, double dt_s) {
  auto& meter = *meter_;
  if (moment.layout == nullptr) return false;
  const auto& layout = *moment.layout;
  const auto &from = stage().line_m.front(), &to = stage().line_m.back();
  if (meter.piece_epoch != layout.epoch) {
    meter.piece_epoch = layout.epoch;
    meter.piece = find_loose_piece(layout, from);
  }
  if (meter.piece.empty()) return false;
  const auto piece = place_piece(layout, moment.displacements, meter.piece);
  const auto holding = std::ranges::count_if(moment.tips, [&](const Tip& tip) {
    return tip.verb == tool::Verb::Grasp && tip.has_claim &&
           std::ranges::any_of(piece.corners, [&](const Vec3d& corner) {
             return length(corner - tip.position_m) < kInHandM;
           });
  });
  meter.off_m = length(piece.centre_m - to);
  const bool is_there = meter.off_m <= stage().tolerance_m;
  if (meter.is_in_hand && holding == 0 && !is_there) meter.drops += 1;
  meter.is_in_hand = holding > 0;
  meter.most_hands = std::max(meter.most_hands, static_cast<int>(holding));
  const bool is_given = meter.most_hands >= stage().hands;
  meter.held_s = is_there && holding == 0 && is_given ? meter.held_s + dt_s : 0;
  const double near = std::clamp(1 - meter.off_m / length(from - to), 0.0, 1.0);
  progress_ = std::min(1.0, 0.5 * near + 0.5 * meter.held_s / stage().hold_s);
  return meter.held_s >= stage().hold_s;
}

bool Course::is_reached(const Moment& moment, double dt_s) {
  switch (stage().goal) {
    case Goal::Find:
      return false;  // an answer reaches it
    case Goal::Follow:
      return follows(moment, dt_s);
    case Goal::Lift:
      return lifts(moment, dt_s);
    case Goal::Hold:
      return holds(moment, dt_s);
    case Goal::Carry:
      return carries(moment, dt_s);
    case Goal::Incise:
      progress_ = std::min(1.0, meter_->incision.covered / kCovered);
      return meter_->incision.covered >= kCovered;
    case Goal::Remove:
      return meter_->specimen.has_value();
  }
  return false;
}

bool Course::observe(const Moment& moment) {
  const bool is_first = !tick_;
  const double dt_s = is_first ? 0 : seconds_of(moment.tick - *tick_);
  tick_ = moment.tick;
  if (is_over()) return false;
  if (is_first) begin_ = moment.tick;
  measure(moment, dt_s);
  if (moment.layout != nullptr) look_at_wound(moment);
  if (is_reached(moment, dt_s)) {
    end_stage(true);
    return true;
  }
  if (seconds() < stage().limit_s) return false;
  end_stage(false);
  return true;
}

Answer Course::answer(ToolSlot tool, const Moment& moment) {
  if (is_over() || stage().goal != Goal::Find) return Answer::NotAsked;
  const auto tip = std::ranges::find(moment.tips, tool, &Tip::tool);
  if (tip == moment.tips.end() || moment.layout == nullptr) return Answer::NoTissue;
  const auto& layout = *moment.layout;
  double nearest = kTouchM;
  std::optional<Vec3d> place;
  const auto vertices = std::min(layout.vertex_count(), moment.displacements.size());
  for (std::uint32_t v = 0; v < vertices; ++v) {
    const auto rest = layout.rest_m(VertexIndex(v));
    const auto now = rest + to_double(wire::to_metres(moment.displacements[v]));
    if (const double distance = length(now - tip->position_m); distance < nearest)
      nearest = distance, place = rest;
  }
  if (!place) return Answer::NoTissue;
  const auto& structure = *lesson_.find_structure(stage().structure);
  const double error = std::max(0.0, structure.distance_m(*place));
  if (error > stage().tolerance_m) {
    meter_->wrong += 1;
    return Answer::Wrong;
  }
  meter_->answer_error_m = error;
  end_stage(true);
  return Answer::Right;
}

}  // namespace trocar::lesson
