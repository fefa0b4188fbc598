#include "server/tissue/contact/proxies.h"

#include <algorithm>

#include "server/tissue/contact/contact_law.h"
#include "server/tissue/contact/tool_solid.h"

namespace trocar::contact {
namespace {

constexpr int kMaxPushesOut = 24;
constexpr float kOutside_m = 1e-6f;
// This part of a tool's radius may be left inside where the surface holds it from all sides. A tool
// that is deeper goes back to where it was, if it is less deep there.
constexpr float kLeftInside = 0.1f;
// A tool walks at most by what it came nearer to its hand in the tick before and a fifth, and,
// where it presses, as deep as its force still grows; else, so that one that is far behind its hand
// does not leap into what it meets, by kFree_m, 500 m/s^2. Where tissue throws it is no walk: a
// tool that is thrown about would go ever deeper.
constexpr float kFaster = 1.2f, kDeeper = 1.5f, kFree_m = 0.0005f;

struct Depenetration {
  Vec3f moved;      // m, of the tool
  float depth = 0;  // m, of the point that is still deepest inside
};
// Pushes the tool out where it is deepest, then where it is deepest after that, and so on.
Depenetration depenetrate(const PlaneArrays& planes, const Vec3f& from) {
  Depenetration result{from};
  for (int i = 0; i <= kMaxPushesOut; ++i) {
    const auto deepest = planes.deepest(result.moved, kOutside_m);
    result.depth = deepest.depth;
    if (deepest.point == PlaneArrays::kNone || i == kMaxPushesOut) break;
    result.moved -= planes.normal(deepest.point) * result.depth;
  }
  return result;
}

void follow_push(const ContactList& contacts, const ToolContact& tool, const world::World& world,
                 const hands::Tool& hand, PlaneArrays& planes, Proxy& proxy) {
  proxy.is_placed = tool.is_placed;
  proxy.pose = tool.goal;
  proxy.hand = hand.pose;
  proxy.point_ids.clear();
  proxy.anchors.clear();
  const auto points = contacts.points_of(tool);
  planes.clear();
  for (const auto& point : points)
    planes.add(point.normal, displacement_of(point, world) - point.plane);
  for (const auto& point : points) {
    const Vec3f d = displacement_of(point, world);
    const auto load = load_at(point, d);
    if (!(load.pressed_n > 0)) continue;
    // Across the face it is where the slip ends that friction can hold; along the normal it is of
    // no account, and stays with the point.
    const Vec3f held = load.slides ? d - load.slip * (load.tangential_secant / point.hold_stiffness)
                                   : d - load.slip;
    proxy.point_ids.push_back(point.id);
    proxy.anchors.push_back(tool.goal.apply_inverse(rest_position_of(point, world) + held));
  }
  auto out = depenetrate(planes, {});
  if (out.depth > kLeftInside * hand.shape.radius_m) {
    const auto back = depenetrate(planes, tool.start.position - tool.goal.position);
    if (back.depth < out.depth) {
      out = back;
      proxy.pose.orientation = tool.start.orientation;
    }
  }
  proxy.pose.position += out.moved;
  const float walked = std::max(0.0f, way_between(tool.start, hand.pose, hand.shape) -
                                          way_between(proxy.pose, hand.pose, hand.shape));
  proxy.step_m = kFaster * walked + (proxy.point_ids.empty() ? kFree_m : kDeeper * tool.softness_m);
}

}  // namespace

void PlaneArrays::add(const Vec3f& normal, const Vec3f& at) {
  const auto block = count_ / kAtOnce, i = count_ % kAtOnce;
  if (block == blocks_.size()) blocks_.emplace_back();
  Block& b = blocks_[block];
  if (i == 0) b = {};  // planes without a normal: nothing is deep behind them
  b.normal_x[i] = normal.x, b.normal_y[i] = normal.y, b.normal_z[i] = normal.z;
  b.x[i] = at.x, b.y[i] = at.y, b.z[i] = at.z;
  ++count_;
}

Vec3f PlaneArrays::normal(std::size_t point) const {
  const Block& b = blocks_[point / kAtOnce];
  const auto i = point % kAtOnce;
  return {b.normal_x[i], b.normal_y[i], b.normal_z[i]};
}

PlaneArrays::Deepest PlaneArrays::deepest(const Vec3f& moved, float at_least) const {
  Deepest result{kNone, at_least};
  for (std::size_t block = 0; block * kAtOnce < count_; ++block) {
    const Block& b = blocks_[block];
    std::array<float, kAtOnce> depths;
    for (std::size_t i = 0; i < kAtOnce; ++i)
      depths[i] = -dot({b.normal_x[i], b.normal_y[i], b.normal_z[i]},
                       Vec3f{b.x[i], b.y[i], b.z[i]} - moved);
    for (std::size_t i = 0; i < kAtOnce; ++i)
      if (depths[i] > result.depth) result = {block * kAtOnce + i, depths[i]};
  }
  return result;
}

Reaction reaction_on(const ContactList& contacts, const ToolContact& tool,
                     const world::World& world) {
  Reaction reaction;
  for (const auto& point : contacts.points_of(tool)) {
    const Vec3f d = displacement_of(point, world);
    const auto load = load_at(point, d);
    reaction.force_n += load.gradient;
    const Vec3f arm = rest_position_of(point, world) + d - tool.goal.position;
    reaction.torque_nm += cross(arm, load.gradient);
    if (point.kind == ContactPoint::Kind::Push)
      reaction.penetration_m =
          std::max(reaction.penetration_m, -dot(point.normal, d - point.plane));
  }
  return reaction;
}

void ProxyTable::update(const ContactList& contacts, const world::World& world,
                        const hands::ToolTable& tools) {
  std::array<bool, kMaxTools> pushes{};
  for (const auto& tool : contacts.tools) {
    if (tool.verb != tool::Verb::Push) continue;
    pushes[tool.tool.value] = true;
    follow_push(contacts, tool, world, tools[tool.tool], planes_, proxies_[tool.tool.value]);
  }
  for (std::size_t i = 0; i < proxies_.size(); ++i) {
    if (pushes[i] || !proxies_[i].is_placed) continue;
    proxies_[i].is_placed = false;
    proxies_[i].pose = proxies_[i].hand = {};
    proxies_[i].step_m = 0;
    proxies_[i].point_ids.clear();
    proxies_[i].anchors.clear();
  }
}

void ProxyTable::visit_state(world::StateArchive& archive) {
  for (auto& proxy : proxies_) {
    archive.flag(proxy.is_placed);
    archive.value(proxy.pose);
    archive.value(proxy.hand);
    archive.value(proxy.step_m);
    archive.sized_array(proxy.point_ids, kMaxPointsPerTool);
    archive.sized_array(proxy.anchors, kMaxPointsPerTool);
    if (archive.is_reading() && proxy.point_ids.size() != proxy.anchors.size()) archive.fail();
  }
}

}  // namespace trocar::contact
