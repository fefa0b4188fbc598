#include "server/tissue/thread/solids.h"

#include <algorithm>

namespace trocar::thread {
namespace {

constexpr double kAheadM = 1e-4;        // a contact is there before it presses
constexpr double kDeepestM = 0.5e-3;    // deeper a solid presses no harder
constexpr std::uint32_t kNearJaws = 3;  // nodes from what jaws hold
constexpr double kFacing = 0.5;         // a normal that has turned farther is of the other side
constexpr std::uint8_t kFloor = 0xfe;
constexpr std::uint8_t kFirstTool = 0x40;

double place_on_axis(const Capsule& capsule, const Vec3d& p) {
  const Vec3d axis = capsule.to_m - capsule.from_m;
  const double all = length_squared(axis);
  return all > 0 ? std::clamp(dot(p - capsule.from_m, axis) / all, 0.0, 1.0) : 0;
}

Vec3d at(const Capsule& capsule, double part) {
  return capsule.from_m + (capsule.to_m - capsule.from_m) * part;
}

// Jaws do not push away what they hold, nor what leaves them.
bool is_between_jaws(const Holds& holds, std::uint32_t node, ToolSlot tool) {
  for (std::size_t k = 0; k < holds.nodes.size(); ++k)
    if (holds.tools[k] == tool && holds.nodes[k] <= node + kNearJaws &&
        node <= holds.nodes[k] + kNearJaws)
      return true;
  return false;
}

}  // namespace

Solids::Solids(const Rules& rules) : floor_y_m_(rules.floor_y_m) {
  for (const auto& peg : rules.pegs) {
    const Capsule capsule{peg.from_m, peg.to_m};
    pegs_.push_back({capsule,
                     capsule,
                     peg.radius_m,
                     peg.friction,
                     static_cast<std::uint8_t>(pegs_.size()),
                     {}});
  }
  peg_forces_n_.resize(pegs_.size());
}

Solids::Gap Solids::gap_of(const Contact& contact, const Vec3d& place_m) const {
  if (contact.solid == kFloor) return {contact.normal, place_m.y - *floor_y_m_};
  const auto& solid = solids_[contact.solid];
  const Vec3d axis = at(solid.now, place_on_axis(solid.now, place_m));
  const Vec3d out = place_m - axis;
  const double distance = length(out);
  if (dot(out, contact.normal) >= kFacing * distance && distance > 0)
    return {out / distance, distance - solid.radius_m};
  return {contact.normal, dot(out, contact.normal) - solid.radius_m};
}

void Solids::find_near(std::uint32_t number, const Elasticity& elasticity, const Threads& threads) {
  const auto& solid = solids_[number];
  const double moved_m = std::max(length(solid.now.from_m - solid.before.from_m),
                                  length(solid.now.to_m - solid.before.to_m));
  for (std::uint32_t i = 0; i < threads.node_count(); ++i) {
    const Vec3d& was = elasticity.before()[i];
    const double reach_m = solid.radius_m + moved_m + length(threads.places_m[i] - was) + kAheadM;
    const double part = place_on_axis(solid.before, was);
    const Vec3d out = was - at(solid.before, part);
    if (length_squared(out) > reach_m * reach_m) continue;
    if (solid.tool.is_valid() && is_between_jaws(threads.holds, i, solid.tool)) continue;
    Contact contact{i,
                    number,
                    normalized(out, Vec3d{0, 1, 0}),
                    at(solid.now, part) - at(solid.before, part),
                    {}};
    if (threads.touched[i] == solid.number) contact.creep_m = threads.creeps_m[i];
    contacts_.push_back(contact);
  }
}

void Solids::find_on_floor(const Elasticity& elasticity, const Threads& threads) {
  for (std::uint32_t i = 0; i < threads.node_count(); ++i) {
    const double least = std::min(elasticity.before()[i].y, threads.places_m[i].y);
    if (least > *floor_y_m_ + kAheadM) continue;
    Contact contact{i, kFloor, {0, 1, 0}, {}, {}};
    if (threads.touched[i] == kFloor) contact.creep_m = threads.creeps_m[i];
    contacts_.push_back(contact);
  }
}

void Solids::find(std::span<const Solid> tools, const Elasticity& elasticity,
                  const Threads& threads) {
  solids_.assign(pegs_.begin(), pegs_.end());
  for (const auto& tool : tools) {
    solids_.push_back(tool);
    solids_.back().number = static_cast<std::uint8_t>(kFirstTool + tool.tool.value);
  }
  contacts_.clear();
  pushes_.clear();
  for (std::uint32_t number = 0; number < solids_.size(); ++number)
    find_near(number, elasticity, threads);
  if (floor_y_m_) find_on_floor(elasticity, threads);
}

std::optional<Solids::Touch> Solids::touch_of(const Contact& contact, const Elasticity& elasticity,
                                              const Threads& threads) const {
  const Vec3d& place = threads.places_m[contact.node];
  const auto [normal, gap_m] = gap_of(contact, place);
  if (gap_m >= 0) return {};
  Touch touch;
  touch.normal = normal;
  touch.friction = contact.solid == kFloor ? kThreadFriction : solids_[contact.solid].friction;
  touch.slip_m = contact.creep_m + place - elasticity.before()[contact.node] - contact.motion_m;
  touch.rub = rub(normal, kPressN_m * std::min(-gap_m, kDeepestM), touch.friction, touch.slip_m);
  return touch;
}

void Solids::add(const Elasticity& elasticity, const Threads& threads, ChainSolver& solver) const {
  for (const auto& contact : contacts_)
    if (const auto touch = touch_of(contact, elasticity, threads)) {
      solver.add_right(contact.node, to_column(touch->rub.force_n));
      solver.add_diagonal(contact.node, touch->rub.stiffness);
    }
}

void Solids::end(const Elasticity& elasticity, Threads& threads) {
  pushes_.clear();
  std::ranges::fill(peg_forces_n_, Vec3d{});
  std::ranges::fill(threads.touched, kTouchesNothing);
  std::ranges::fill(threads.creeps_m, Vec3d{});
  hardest_n_.assign(threads.node_count(), 0.0);
  for (const auto& contact : contacts_) {
    const auto touch = touch_of(contact, elasticity, threads);
    if (!touch) continue;
    const bool is_floor = contact.solid == kFloor;
    const double press_n = touch->rub.press_n;
    if (press_n > hardest_n_[contact.node]) {
      hardest_n_[contact.node] = press_n;
      threads.touched[contact.node] = is_floor ? kFloor : solids_[contact.solid].number;
      threads.creeps_m[contact.node] =
          held_slip(touch->normal, press_n, touch->friction, touch->slip_m);
    }
    if (is_floor) continue;
    const auto& solid = solids_[contact.solid];
    if (solid.tool.is_valid())
      pushes_.push_back({solid.tool, -touch->rub.force_n, threads.places_m[contact.node]});
    else
      peg_forces_n_[solid.number] -= touch->rub.force_n;
  }
}

}  // namespace trocar::thread
