#include "tests/snapshots/random_session.h"

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/organ/organ_file.h"

namespace trocar::testing {
namespace {

constexpr std::uint8_t kHands = 4;
constexpr std::uint32_t kLongestPause = 150;  // ticks from one snapshot to the next
// A restored state goes on for so many ticks: at least over one publication.
constexpr Tick kLeastContinued = 17, kMostContinued = 60;

double speed_m_s(Random& random) {
  return random.between(0.05, 0.4);
}

}  // namespace

const char* name_of(SnapshotOrgan organ) {
  switch (organ) {
    case SnapshotOrgan::Liver:
      return "liver";
    case SnapshotOrgan::MeasuredLiver:
      return "measured liver";
    case SnapshotOrgan::Plate:
      return "plate";
    case SnapshotOrgan::Stomach:
      return "stomach";
    case SnapshotOrgan::Chest:
      return "chest";
    case SnapshotOrgan::Lattice:
      return "lattice";
  }
  return "?";
}

SnapshotFigures& SnapshotFigures::operator+=(const SnapshotFigures& other) {
  snapshots += other.snapshots, bytes += other.bytes;
  in_a_cut += other.in_a_cut, cut += other.cut, after_a_tear += other.after_a_tear;
  self_contact += other.self_contact, grasp += other.grasp, push += other.push;
  mark += other.mark, ticks_continued += other.ticks_continued;
  return *this;
}

SnapshotScene random_scene(SnapshotOrgan kind, std::uint64_t seed) {
  using material::ElasticLaw;
  Random random(seed);
  SnapshotScene scene;
  auto& organ = scene.organ;
  const int tets = 600 + static_cast<int>(random.below(3000));
  switch (kind) {
    case SnapshotOrgan::Liver:
      organ = *catalogue::make_liver(tets);
      organ.material.elastic_law = static_cast<ElasticLaw>(random.below(3));
      organ.material.young_modulus_pa = random.between(1500, 20000);
      break;
    case SnapshotOrgan::MeasuredLiver:
      organ = *catalogue::make_measured_liver(tets);
      break;
    case SnapshotOrgan::Plate:
      organ = catalogue::make_plate();
      break;
    case SnapshotOrgan::Stomach:
      organ = *catalogue::make_stomach(catalogue::kMinStomachTets);
      break;
    case SnapshotOrgan::Chest:
      organ = catalogue::make_chest();
      break;
    case SnapshotOrgan::Lattice:
      organ = *catalogue::make_lattice({.nx = 8, .ny = 5, .nz = 7});
      return scene;
  }
  organ.material.has_averaged_strain =
      organ.material.elastic_law != ElasticLaw::Springs && random.below(3) == 0;
  if (random.below(2) == 0) organ.material.tension = random.between(0.01, 0.06);
  if (random.below(2) == 0) organ.material.tear_stretch = random.between(1.2, 1.6);
  // All cut at one place, so that wounds meet wounds.
  const bool is_large = kind == SnapshotOrgan::Stomach || kind == SnapshotOrgan::Chest;
  if (is_large || random.below(2) == 0) scene.reach_m = 0.06f;
  return scene;
}

SnapshotScene loaded_scene(std::uint64_t seed) {
  constexpr double kPart_m = 0.025, kMost_m = 0.005, kMost_n = 0.1;
  auto scene =
      random_scene(seed % 2 == 0 ? SnapshotOrgan::Liver : SnapshotOrgan::MeasuredLiver, seed);
  const auto& mesh = scene.organ.mesh;
  Random random(seed);
  std::vector<std::uint8_t> is_taken(mesh.node_count());
  for (const auto node : scene.organ.fixed_nodes) is_taken[node.value] = 1;
  const auto take_part = [&] {
    const auto count = static_cast<std::uint32_t>(mesh.surface_nodes.size());
    std::vector<NodeIndex> nodes;
    while (nodes.empty()) {
      const auto& middle = mesh.rest_positions[mesh.surface_nodes[random.below(count)].value];
      for (std::uint32_t n = 0; n < mesh.node_count(); ++n)
        if (is_taken[n] == 0 && length(mesh.rest_positions[n] - middle) < kPart_m)
          nodes.emplace_back(n), is_taken[n] = 1;
    }
    return nodes;
  };
  const auto curve = [&random](double most) {
    step::TimedVector over_time;
    for (int key = 0; key < 20; ++key) {
      auto& [time_s, value] = over_time.keys.emplace_back();
      time_s = 0.2 * key;
      for (double* part : {&value.x, &value.y, &value.z}) *part = random.between(-most, most);
    }
    return over_time;
  };
  scene.loads.displaced.push_back({take_part(), step::kAllAxes, curve(kMost_m)});
  const auto axes = static_cast<std::uint8_t>(1 + random.below(6));
  scene.loads.displaced.push_back({take_part(), axes, {{{0, {}}}}});
  auto& pulled = scene.loads.forces.emplace_back();
  pulled.nodes = take_part();
  pulled.over_time = curve(kMost_n);
  pulled.shares.assign(pulled.nodes.size(), 1.0 / static_cast<double>(pulled.nodes.size()));
  TROCAR_ASSERT(step::validate(scene.loads, scene.organ).ok());
  return scene;
}

RandomSession::RandomSession(SnapshotScene scene, std::uint64_t seed)
    : simulation_(std::move(scene.organ), 1, {.loads = std::move(scene.loads)}),
      reach_m_(scene.reach_m),
      random_(seed),
      hands_(kHands) {
  for (std::size_t i = 0; i < hands_.size(); ++i)
    hands_[i].work = i < 2 ? Work::Scalpel : i == 2 ? Work::Forceps : Work::Finger;
  const auto& nodes = simulation_.state().world.surface_nodes;
  home_ = nodes[random_.below(static_cast<std::uint32_t>(nodes.size()))];
}

RandomSession::~RandomSession() = default;

NodeIndex RandomSession::any_surface_node() {
  const auto& world = simulation_.state().world;
  NodeIndex node;
  for (int tries = 0; tries < 200; ++tries) {
    node =
        world.surface_nodes[random_.below(static_cast<std::uint32_t>(world.surface_nodes.size()))];
    const Vec3f way = world.rest_positions[node.value] - world.rest_positions[home_.value];
    if (reach_m_ <= 0 || length_squared(way) < reach_m_ * reach_m_) break;
  }
  return node;
}

// Away from the organ's middle, roughly.
Vec3f RandomSession::out_of(NodeIndex node) const {
  const Vec3f at = simulation_.state().world.rest_positions[node.value];
  return normalized(at + Vec3f{0, 0.05f, 0}, Vec3f{0, 1, 0});
}

void RandomSession::plan(Hand& hand, Tick now) {
  const auto& world = simulation_.state().world;
  const auto at = [&](NodeIndex node) {
    return world.rest_positions[node.value] + world.displacements[node.value];
  };
  const auto a = any_surface_node();
  NodeIndex b = any_surface_node();
  for (int tries = 0; tries < 30 && length(at(b) - at(a)) > 0.07f; ++tries) b = any_surface_node();
  const Vec3f out = out_of(a);
  const auto depth = static_cast<float>(random_.between(0.003, 0.02));
  const Vec3f away = at(a) + out * 0.03f;
  const auto orientation = rotation_from_z(out);
  using enum tool::Verb;
  std::vector<std::pair<Vec3f, tool::Verb>> stations;
  switch (hand.work) {
    case Work::Scalpel:
      stations = {{away, Cut},
                  {at(a) - out * depth, Cut},
                  {at(b) - out * depth, Cut},
                  {at(b) + out * 0.03f, Cut}};
      if (random_.below(3) == 0) stations.pop_back();  // lifted inside the tissue
      stations.emplace_back(stations.back().first + out * 0.01f, None);
      break;
    case Work::Forceps: {
      const Vec3f pull =
          out * static_cast<float>(random_.between(0.005, 0.08)) + (at(b) - at(a)) * 0.5f;
      stations = {{away, None},
                  {at(a), None},
                  {at(a), Grasp},
                  {at(a) + pull, Grasp},
                  {at(a) + pull * 0.5f, Grasp},
                  {at(a) + pull * 0.5f, None}};
      break;
    }
    case Work::Finger:
      stations = {{away, Push},
                  {at(a) - out * depth, Push},
                  {at(b) - out * depth, Push},
                  {at(b) + out * 0.03f, Push}};
      break;
  }
  hand.keys.clear();
  const double speed = speed_m_s(random_);
  Tick tick = now;
  Vec3f from = stations.front().first;
  for (const auto& [place, verb] : stations) {
    tick += 4 + static_cast<Tick>(1000.0 * static_cast<double>(length(place - from)) / speed);
    hand.keys.push_back({tick, {place, orientation}, verb});
    from = place;
  }
}

Pose RandomSession::pose_at(const Hand& hand, Tick now, tool::Verb& verb) const {
  std::size_t next = 0;
  while (next + 1 < hand.keys.size() && hand.keys[next].tick < now) ++next;
  const auto& to = hand.keys[next];
  verb = to.verb;
  if (next == 0 || to.tick <= now) return to.pose;
  const auto& from = hand.keys[next - 1];
  const float t = static_cast<float>(now - from.tick) / static_cast<float>(to.tick - from.tick);
  return {from.pose.position + (to.pose.position - from.pose.position) * t, to.pose.orientation};
}

tool::ToolShape RandomSession::random_edge() {
  constexpr std::array kForms{tool::Form::Scissors, tool::Form::Hook, tool::Form::Scalpel};
  return {.radius_m = 0.0015f,
          .length_m = 0.2f,
          .reach_m = 0.008f,
          .edge_m = static_cast<float>(random_.between(0.004, 0.045)),
          .form = kForms[random_.below(kForms.size())]};
}

void RandomSession::make_inputs() {
  const Tick now = simulation_.current_tick() + 1;
  inputs_.clear();
  for (std::uint8_t i = 0; i < kHands; ++i) {
    auto& hand = hands_[i];
    if (!hand.is_present) {
      if (now > 1 && random_.below(100) != 0) continue;
      hands::HandJoin join{.slot = {i}};
      auto& shape = join.shapes[0];
      if (hand.work == Work::Scalpel)
        shape = {.radius_m = 0.0015f, .length_m = 0.2f, .reach_m = 0.008f, .edge_m = 0.045f};
      else
        shape = {.radius_m = hand.work == Work::Forceps ? 0.003f : 0.008f,
                 .length_m = 0.2f,
                 .reach_m = static_cast<float>(random_.between(0.006, 0.014))};
      inputs_.joins.push_back(join);
      hand.is_present = true;
      hand.keys.clear();
      continue;
    }
    if (random_.below(8000) == 0) {  // the tissue it holds is let go by the rules for the absent
      inputs_.leaves.push_back({i});
      hand.is_present = false;
      continue;
    }
    if (hand.work == Work::Scalpel && random_.below(3000) == 0)
      inputs_.changes.push_back({tool_slot({i}, 0), random_edge()});
    if (hand.keys.empty() || hand.keys.back().tick < now) plan(hand, now);
    if ((now + i) % 4 != 0) continue;
    tool::Verb verb = tool::Verb::None;
    const Pose pose = pose_at(hand, now, verb);
    inputs_.samples.push_back({tool_slot({i}, 0), {pose, verb}});
  }
  const auto mark = random_.below(4000);
  if (mark == 0) inputs_.mark = hands::MarkAction::Set;
  if (mark == 1) inputs_.mark = hands::MarkAction::Return;
  if (random_.below(400) != 0) return;
  decisions_.boundary = random_.below(4) == 0 ? world::Boundary::Frozen : world::Boundary::Graded;
  decisions_.depth_limit = 1 + random_.below(6);
  decisions_.node_limit = 50 + random_.below(1500);
  decisions_.sweeps = 3 + random_.below(4);
  decisions_.far_interval = 1 + random_.below(3);
  decisions_.is_far_exact = random_.below(4) == 0;
  decisions_.waiting_tools = decisions_.node_limit % 4 == 0 ? decisions_.node_limit / 4 % 16 : 0;
}

void RandomSession::count_state() {
  const auto& state = simulation_.state();
  ++figures_.snapshots;
  figures_.bytes += bytes_.size();
  figures_.cut += !state.cuts.history().empty();
  figures_.after_a_tear += torn_m2_ > 0;
  figures_.self_contact += !state.self_contacts.nodes().empty();
  figures_.mark += state.marks.is_set();
  bool has_cut = false, has_grasp = false, has_push = false;
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    if (!state.claims.is_in_effect(ToolSlot{i})) continue;
    const auto verb = state.claims.claim(ToolSlot{i}).verb;
    has_cut |= verb == tool::Verb::Cut;
    has_grasp |= verb == tool::Verb::Grasp;
    has_push |= verb == tool::Verb::Push;
  }
  figures_.in_a_cut += has_cut, figures_.grasp += has_grasp, figures_.push += has_push;
}

std::string RandomSession::snapshot() {
  const Tick tick = simulation_.current_tick();
  bytes_.clear();
  again_.clear();
  simulation_.write_snapshot(bytes_);
  count_state();
  auto restored = std::make_unique<step::Simulation>(simulation_.beside());
  if (const Status read = restored->restore_snapshot(bytes_); !read.ok())
    return "tick " + std::to_string(tick) + ": " + read.error().message;
  restored->write_snapshot(again_);
  if (again_ != bytes_) return "tick " + std::to_string(tick) + ": restored, it has other bytes";
  if (restored->state_hash() != simulation_.state_hash())
    return "tick " + std::to_string(tick) + ": restored, it has another hash";
  restored_.push_back(
      {std::move(restored), tick,
       tick + kLeastContinued + random_.below(static_cast<std::uint32_t>(kMostContinued))});
  return {};
}

std::string RandomSession::run(std::uint64_t snapshots) {
  const auto wanted = figures_.snapshots + snapshots;
  while (figures_.snapshots < wanted || !restored_.empty()) {
    make_inputs();
    const auto& report = simulation_.tick(inputs_, decisions_);
    torn_m2_ += report.cut.torn_area_m2;
    for (auto& restored : restored_) {
      ++figures_.ticks_continued;
      if (restored.simulation->tick(inputs_, decisions_).state_hash != report.state_hash)
        return "tick " + std::to_string(report.tick) + ": restored from tick " +
               std::to_string(restored.tick) + ", it went on otherwise";
    }
    std::erase_if(restored_, [&](const Restored& r) { return r.until <= report.tick; });
    if (report.tick < next_snapshot_ || figures_.snapshots >= wanted) continue;
    next_snapshot_ = report.tick + 1 + random_.below(kLongestPause);
    if (auto wrong = snapshot(); !wrong.empty()) return wrong;
  }
  return {};
}

}  // namespace trocar::testing
