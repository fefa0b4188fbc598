#include "server/tissue/contact/proxies.h"

#include <algorithm>

#include "server/tissue/contact/contact_law.h"
#include "server/tissue/contact/tool_solid.h"

namespace trocar::contact {
namespace {

// Friction makes force of where a tool stands: a thin tip feels a micrometre.
constexpr float kOutside_m = 1e-7f;
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

// WayOut leads a tool to the nearest place outside of all planes (Hildreth 1957): in each turn the
// plane that is worst off pushes the tool out of it, or lets it back by what it pushed too far.
// That place follows the planes evenly. One that pushes alone lead to does not: tissue that hardly
// moves would throw a thin tip to and fro. O(turns times points / 8).
class WayOut {
 public:
  WayOut(const PlaneArrays& planes, const Vec3f& from) : planes_(planes), moved_(from) {
    for (int i = 0; i < kMostTurns && take_turn(); ++i) {
    }
  }
  Depenetration end() const { return {moved_, planes_.deepest(moved_, kOutside_m).depth}; }

 private:
  static constexpr int kMostTurns = 128;
  static constexpr std::size_t kMostWalls = 16;
  // A plane that keeps the tool out.
  struct Wall {
    std::size_t point = 0;
    Vec3f normal;
    float depth = 0;   // m, of its point if the tool had not moved
    float pushed = 0;  // m, out of it in all
  };

  // Returns whether there was something to do.
  bool take_turn() {
    const auto deepest = planes_.deepest(moved_, kOutside_m);
    if (let_back(deepest.depth)) return true;
    if (deepest.point == PlaneArrays::kNone) return false;
    push(deepest);
    return true;
  }
  // Lets the tool back from the wall that pushed it farthest beyond, if by more than at_least, m.
  bool let_back(float at_least) {
    std::size_t farthest = count_;
    for (std::size_t i = 0; i < count_; ++i) {
      const auto& wall = walls_[i];
      const float beyond = std::min(-wall.depth - dot(wall.normal, moved_), wall.pushed);
      if (beyond > at_least) at_least = beyond, farthest = i;
    }
    if (farthest == count_) return false;
    Wall& wall = walls_[farthest];
    moved_ += wall.normal * at_least;
    wall.pushed -= at_least;
    if (!(wall.pushed > 0)) wall = walls_[--count_];
    return true;
  }
  // Pushes by walls beyond kMostWalls are not let back.
  void push(const PlaneArrays::Deepest& deepest) {
    const Vec3f normal = planes_.normal(deepest.point);
    const auto end = walls_.begin() + count_;
    const auto found = std::find_if(walls_.begin(), end,
                                    [&](const Wall& wall) { return wall.point == deepest.point; });
    if (found != end)
      found->pushed += deepest.depth;
    else if (count_ < kMostWalls)
      walls_[count_++] = {deepest.point, normal, deepest.depth - dot(normal, moved_),
                          deepest.depth};
    moved_ -= normal * deepest.depth;
  }

  const PlaneArrays& planes_;
  Vec3f moved_;
  std::array<Wall, kMostWalls> walls_;
  std::size_t count_ = 0;
};

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
  auto out = WayOut(planes, {}).end();
  if (out.depth > kLeftInside * hand.shape.radius_m) {
    const auto back = WayOut(planes, tool.start.position - tool.goal.position).end();
    if (back.depth < out.depth) {
      out = back;
      proxy.pose.orientation = tool.start.orientation;
    }
  }
  proxy.pose.position += out.moved;
  const float walked = std::max(0.0f, way_between(tool.start, hand.pose, hand.shape) -
                                          way_between(proxy.pose, hand.pose, hand.shape));
  proxy.step_m = kFaster * walked + (proxy.presses() ? kDeeper * tool.softness_m : kFree_m);
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
