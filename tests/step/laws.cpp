#include "tests/step/laws.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "server/tissue/step/simulation.h"
#include "tests/step/law_organs.h"
#include "tests/support/random.h"

namespace trocar::step::testing {
namespace {

using trocar::testing::Random;

enum class Work { Pull, Twist, Press, Cut, CutAndStretch };

constexpr const char* kWorkNames[kLawWorks] = {"pulled", "twisted", "pressed", "cut",
                                               "cut and stretched"};
constexpr double kSpeeds_m_s[kLawSpeeds] = {0.02, 0.05, 0.1, 0.2, 0.4, 0.8};
constexpr int kCheckEvery = 4;  // ticks
constexpr Tick kAlone = 600;

// One tool's way: places with the seconds that it takes to get there, straight, and what it does.
struct Station {
  float time_s = 0;
  Pose pose;
  tool::Verb verb = tool::Verb::None;
};

class Scene {
 public:
  Scene(int organ, Work work, double speed_m_s, std::uint64_t seed)
      : random_(seed),
        simulation_(law_organ(organ, seed)),
        speed_(static_cast<float>(speed_m_s)),
        is_free_(simulation_.organ().fixed_nodes.empty()) {
    for (const auto& p : simulation_.state().world.rest_positions) {
      low_ = {std::min(low_.x, p.x), std::min(low_.y, p.y), std::min(low_.z, p.z)};
      high_ = {std::max(high_.x, p.x), std::max(high_.y, p.y), std::max(high_.z, p.z)};
    }
    const auto& material = simulation_.organ().material;
    const double shear_pa = material::lame_parameters(material).mu_pa;
    constexpr double kStretch = 3;
    spring_back_m_s_ =
        2 * std::sqrt(shear_pa * (kStretch * kStretch + 2 / kStretch - 3) / material.density_kg_m3);
    plan(work);
  }

  LawFigures run() {
    Tick end = 0;
    for (const auto& way : ways_)
      end = std::max(end, static_cast<Tick>(way.back().time_s * 1000) + 1);
    for (Tick tick = 1; tick <= end; ++tick) step(tick);
    is_alone_ = true;
    std::ranges::fill(inverted_, 0);
    for (Tick tick = end + 1; tick <= end + kAlone; ++tick) {
      step(tick);
      if (tick % kCheckEvery == 0) look_alone();
    }
    return figures_;
  }

 private:
  Vec3f size() const { return high_ - low_; }
  Vec3f middle() const { return (low_ + high_) * 0.5f; }
  float number(double low, double high) { return static_cast<float>(random_.between(low, high)); }

  // Returns the node of the surface that is farthest in a direction.
  Vec3f farthest(const Vec3f& direction) const {
    const auto& world = simulation_.state().world;
    NodeIndex best = world.surface_nodes.front();
    for (const auto n : world.surface_nodes)
      if (dot(world.rest_positions[n.value], direction) >
          dot(world.rest_positions[best.value], direction))
        best = n;
    return world.rest_positions[best.value];
  }
  Vec3f any_direction() {
    return normalized(Vec3f{number(-1, 1), number(0, 1), number(-1, 1)}, Vec3f{0, 1, 0});
  }

  void go(std::size_t tool, const Pose& pose, tool::Verb verb, float seconds) {
    if (ways_.size() <= tool) ways_.resize(tool + 1);
    auto& way = ways_[tool];
    way.push_back({(way.empty() ? 0 : way.back().time_s) + seconds, pose, verb});
  }
  void move(std::size_t tool, const Pose& pose, tool::Verb verb) {
    go(tool, pose, verb,
       std::max(0.01f, length(pose.position - ways_[tool].back().pose.position) / speed_));
  }
  void wait(std::size_t tool, float seconds) {
    const auto last = ways_[tool].back();
    go(tool, last.pose, last.verb, seconds);
  }
  void leave(std::size_t tool) {
    auto last = ways_[tool].back();
    go(tool, last.pose, tool::Verb::None, 0.01f);
    last.pose.position += rotate(last.pose.orientation, {0, 0, 0.3f});
    go(tool, last.pose, tool::Verb::None, 0.3f / 0.8f);
  }

  void pull(std::size_t tool, const Vec3f& direction) {
    const Vec3f at = farthest(direction);
    const auto shaft = rotation_from_z(direction);
    go(tool, {at, shaft}, tool::Verb::None, 0);
    go(tool, {at, shaft}, tool::Verb::Grasp, 0.05f);
    for (int i = 0; i < 3; ++i) {
      const Vec3f aside{number(-1, 1), number(-1, 1), number(-1, 1)};
      move(tool, {at + (direction + aside * 0.6f) * (0.7f * size().y), shaft}, tool::Verb::Grasp);
    }
    wait(tool, 0.1f);
  }

  void twist(const std::array<Vec3f, 2>& ends, float angle, float stretch) {
    const Vec3f axis = normalized(ends[1] - ends[0], Vec3f{1, 0, 0});
    for (std::size_t i = 0; i < 2; ++i) {
      const Vec3f out = i == 0 ? -axis : axis;
      const auto shaft = rotation_from_z(out);
      go(i, {ends[i], shaft}, tool::Verb::None, 0);
      go(i, {ends[i], shaft}, tool::Verb::Grasp, 0.05f);
      constexpr int kSteps = 16;
      // The edge of what the jaws hold goes at the speed.
      const float seconds = std::max(angle * 0.01f, stretch) / speed_;
      for (int k = 1; k <= kSteps; ++k) {
        const float share = static_cast<float>(k) / kSteps;
        const float turned = 0.5f * share * angle;
        const Quatf about{0, 0, std::sin(turned / 2), std::cos(turned / 2)};
        go(i, {ends[i] + out * (share * stretch), shaft * about}, tool::Verb::Grasp,
           seconds / kSteps);
      }
      wait(i, 0.2f);
    }
  }

  void cut(std::size_t tool, float height) {
    const Vec3f m = middle();
    const auto at = [&](float side) {
      return Vec3f{m.x + side * 0.8f * size().x, low_.y + height * size().y, m.z - 0.8f * size().z};
    };
    const auto shaft = rotation_from_z({0, 0, 1});
    go(tool, {at(-1), shaft}, tool::Verb::None, 0);
    go(tool, {at(-1), shaft}, tool::Verb::Cut, 0.05f);
    move(tool, {at(1) + Vec3f{0, number(-0.2, 0.2) * size().y, 0}, shaft}, tool::Verb::Cut);
  }

  void plan(Work work) {
    switch (work) {
      case Work::Pull:
        pull(0, any_direction());
        pull(1, any_direction());
        break;
      case Work::Twist:
        twist({farthest({-1, 0, 0}), farthest({1, 0, 0})},
              number(0.5, 1) * std::numbers::pi_v<float>, 0);
        break;
      case Work::Press:
        for (std::size_t i = 0; i < 8; ++i) {
          const float angle = static_cast<float>(i) * std::numbers::pi_v<float> / 4;
          const Vec3f out =
              normalized(Vec3f{std::cos(angle), number(0, 1), std::sin(angle)}, Vec3f{0, 1, 0});
          const Vec3f at = farthest(out);
          const auto shaft = rotation_from_z(out);
          go(i, {at + out * 0.008f, shaft}, tool::Verb::Push, 0);
          move(i, {at - out * (number(0.2, 0.45) * size().y), shaft}, tool::Verb::Push);
          wait(i, 0.3f);
        }
        break;
      case Work::Cut:
        cut(0, number(0.3, 0.7));
        break;
      case Work::CutAndStretch: {
        cut(0, number(0.5, 0.8));
        leave(0);
        const float begin = ways_[0].back().time_s;
        // Then two graspers take the body beside the wound, draw it apart and press it together.
        for (std::size_t i = 1; i < 3; ++i) {
          const float side = i == 1 ? -1.0f : 1.0f;
          const Vec3f at{middle().x + side * 0.3f * size().x, low_.y + 0.4f * size().y, middle().z};
          const auto shaft = rotation_from_z({0, 1, 0});
          go(i, {at + Vec3f{0, 0.05f, 0}, shaft}, tool::Verb::None, begin);
          go(i, {at, shaft}, tool::Verb::Grasp, 0.2f);
          move(i, {at + Vec3f{side * 0.4f * size().x, 0, 0}, shaft}, tool::Verb::Grasp);
          move(i, {at - Vec3f{side * 0.25f * size().x, 0, 0}, shaft}, tool::Verb::Grasp);
          wait(i, 0.1f);
        }
        break;
      }
    }
    for (std::size_t tool = 0; tool < ways_.size(); ++tool) leave(tool);
  }

  static Pose pose_at(const std::vector<Station>& way, float time_s, tool::Verb& verb) {
    std::size_t next = 0;
    while (next < way.size() && way[next].time_s < time_s) ++next;
    if (next == 0 || next == way.size()) {
      const auto& station = next == 0 ? way.front() : way.back();
      verb = station.verb;
      return station.pose;
    }
    const auto &from = way[next - 1], &to = way[next];
    const float share = (time_s - from.time_s) / (to.time_s - from.time_s);
    verb = to.verb;
    return {from.pose.position + (to.pose.position - from.pose.position) * share,
            interpolate(from.pose.orientation, to.pose.orientation, share)};
  }

  void step(Tick tick) {
    hands::TickInputs inputs;
    for (std::size_t i = 0; i < ways_.size(); ++i) {
      const auto hand = static_cast<std::uint8_t>(i);
      if (tick == 1) {
        hands::HandJoin join{.slot = {hand}};
        join.shapes[0] = {
            .radius_m = 0.003f, .length_m = 0.25f, .reach_m = 0.006f, .grip_n = 8, .edge_m = 0.2f};
        inputs.joins.push_back(join);
      }
      tool::Verb verb{};
      const auto pose = pose_at(ways_[i], static_cast<float>(tick) * 1e-3f, verb);
      if (tick % 4 == 1) inputs.samples.push_back({tool_slot({hand}, 0), {pose, verb}});
    }
    simulation_.tick(inputs, {});
    look();
  }

  void look() {
    const auto& world = simulation_.state().world;
    const double most = std::max(4.0 * static_cast<double>(speed_), spring_back_m_s_) +
                        length(simulation_.organ().gravity_m_s2) * 0.1;
    for (const auto& v : world.velocities)
      figures_.speed = std::max(figures_.speed, static_cast<double>(length(v)) / most);
    if (world.tick % kCheckEvery != 0) return;
    const auto& topology = simulation_.state().cuts.topology();
    inverted_.resize(topology.tet_count());
    int& worst = is_alone_ ? figures_.inverted_ticks : figures_.inverted_held_ticks;
    const auto place = [&](NodeIndex n) {
      return topology.rest()[n.value] + to_double(world.displacements[n.value]);
    };
    for (std::uint32_t t = 0; t < topology.tet_count(); ++t) {
      if (!topology.has_tet(TetIndex{t})) continue;
      const auto& [a, b, c, d] = topology.tet(TetIndex{t});
      const Vec3d origin = place(a);
      const bool is_inverted =
          !(dot(cross(place(b) - origin, place(c) - origin), place(d) - origin) > 0);
      inverted_[t] = is_inverted ? inverted_[t] + kCheckEvery : 0;
      worst = std::max(worst, inverted_[t]);
    }
  }

  void look_alone() {
    const auto& world = simulation_.state().world;
    double energy_j = simulation_.context().solve.solver.tissue().energy_j(world.displacements),
           mass = 0;
    Vec3d momentum;
    for (std::size_t n = 0; n < world.node_count(); ++n) {
      const auto m = static_cast<double>(world.masses[n]);
      const Vec3d v = to_double(world.velocities[n]);
      energy_j += 0.5 * m * dot(v, v) -
                  m * dot(simulation_.organ().gravity_m_s2, to_double(world.displacements[n]));
      momentum += v * m;
      mass += m;
    }
    if (is_first_alone_) {
      is_first_alone_ = false;
      first_j_ = least_j_ = energy_j;
      first_m_s_ = momentum / mass;
    }
    least_j_ = std::min(least_j_, energy_j);
    // Less than a microjoule more nobody sees.
    figures_.growth =
        std::max(figures_.growth, (energy_j - least_j_) / std::max(std::abs(first_j_), 1e-4));
    if (is_free_)
      figures_.drift_m_s =
          std::max(figures_.drift_m_s, length(momentum / mass) - length(first_m_s_));
  }

  Random random_;
  Simulation simulation_;
  float speed_;
  bool is_free_;
  double spring_back_m_s_ = 0;
  Vec3f low_{1, 1, 1}, high_{-1, -1, -1};
  std::vector<std::vector<Station>> ways_;
  std::vector<int> inverted_;
  bool is_alone_ = false, is_first_alone_ = true;
  double first_j_ = 0, least_j_ = 0;
  Vec3d first_m_s_;
  LawFigures figures_;
};

}  // namespace

LawScene run_law_scene(int n) {
  const int organ = n % kLawOrgans, work = n / kLawOrgans % kLawWorks,
            speed = n / (kLawOrgans * kLawWorks) % kLawSpeeds;
  Scene scene(organ, static_cast<Work>(work), kSpeeds_m_s[speed], static_cast<std::uint64_t>(n));
  return {fmt::format("scene {}: {}, {}, {:.2f} m/s", n, law_organ_name(organ), kWorkNames[work],
                      kSpeeds_m_s[speed]),
          scene.run()};
}

std::string broken_laws(const LawFigures& figures) {
  constexpr int kMostInverted = 100;
  constexpr double kMostGrowth = 0.01, kMostDrift_m_s = 1e-3;
  std::string broken;
  if (!(figures.speed <= 1))
    broken += fmt::format(" {:.2f} times as fast as may be", figures.speed);
  if (figures.inverted_ticks > kMostInverted)
    broken += fmt::format(" inside out for {} ticks", figures.inverted_ticks);
  if (!(figures.growth <= kMostGrowth))
    broken += fmt::format(" energy grew by {:.3f}", figures.growth);
  if (!(figures.drift_m_s <= kMostDrift_m_s))
    broken += fmt::format(" its middle is {:.4f} m/s faster", figures.drift_m_s);
  return broken;
}

}  // namespace trocar::step::testing
