#include "server/tissue/contact/self_contact_pace.h"

#include <algorithm>
#include <cmath>

#include "server/tissue/contact/contact_list.h"
#include "server/tissue/contact/self_surface_now.h"

namespace trocar::contact {
namespace {

// Nodes in a cube of this width look for pairs in the same ticks.
constexpr float kPhaseCube_m = 0.03f;

std::uint8_t phase_at(const Vec3f& place) {
  const auto cube = [](float x) { return static_cast<std::int32_t>(std::floor(x / kPhaseCube_m)); };
  const auto mixed = cube(place.x) * 23 + cube(place.y) * 37 + cube(place.z) * 11;
  return static_cast<std::uint8_t>(mixed & static_cast<std::int32_t>(kLookEvery - 1));
}

}  // namespace

void SelfContactPace::resize(const SelfSurface& surface) {
  const auto count = surface.node_count();
  for (auto s = static_cast<Site>(phases_.size()); s < count; ++s)
    phases_.push_back(phase_at(surface.rest_position(s)));
  is_looking_.resize(count);
  had_pair_.resize(count);
}

void SelfContactPace::survey(const SelfSurface& surface, const world::World& world) {
  is_any_awake_ = false;
  fastest_squared_ = 0;
  for (const Site s : surface.sites()) {
    is_any_awake_ |= !is_asleep_at(s, world);
    fastest_squared_ = std::max(fastest_squared_, length_squared(world.velocities[s]));
  }
  interval_ = std::min(kPassEvery, ticks_within(kPassDrift_m, fastest_squared_));
}

void SelfContactPace::begin_pass(SelfContactTable& pairs, Tick tick) {
  if (pairs.last_pass() != tick) {
    before_ = pairs.last_pass();
    follows_edit_ = pairs.has_edit();
  }
  pairs.note_pass(tick);
}

// After an edit active nodes of wounds that have no pair look, however slow they are: it may have
// opened them just now.
void SelfContactPace::find_lookers(const SelfSurface& surface, const world::World& world,
                                   std::span<const NodeIndex> paired) {
  auto pair = paired.begin();
  for (const Site s : surface.sites()) {
    const bool has_pair = pair != paired.end() && pair->value == s;
    if (has_pair) ++pair;
    had_pair_[s] = has_pair ? 1 : 0;
    const bool may_be_fresh = follows_edit_ && !has_pair &&
                              world.node_classes[s] == world::NodeClass::Active &&
                              surface.is_of(s, SelfSurface::Sort::Wound);
    const bool looks =
        may_be_fresh ||
        is_turn(phases_[s], ticks_within(kLookDrift_m, length_squared(world.velocities[s])),
                world.tick);
    is_looking_[s] = looks && !is_asleep_at(s, world) ? 1 : 0;
  }
}

float SelfContactPace::margin_of(float closing) const {
  const float seconds = kTickSeconds * (static_cast<float>(interval_) + kSelfTicksAhead);
  return std::min(kSelfMargin_m + seconds * std::max(0.0f, closing), kSelfMaxMargin_m);
}

// No two nodes approach faster than twice the fastest moves.
float SelfContactPace::margin() const {
  return std::min(kSelfMaxMargin_m, margin_of(2.001f * std::sqrt(fastest_squared_)) + kRounding_m);
}

}  // namespace trocar::contact
