#include "tests/bench/our_session.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/base/assert.h"
#include "common/base/checksum.h"
#include "common/base/timing.h"
#include "server/propagation/active_set.h"
#include "server/step/simulation.h"

namespace trocar::bench {
namespace {

constexpr Tick kSampleTicks = 8;
constexpr float kRampTicks = 150;

// The server's own tick.
class SimulationEngine final : public OurSession::Engine {
 public:
  SimulationEngine(scene::Organ organ, const SessionOptions& options)
      : simulation_(std::move(organ)) {
    decisions_ = {
        .depth_limit = options.depth, .node_limit = options.nodes, .sweeps = options.sweeps};
  }

  Tick current_tick() const override { return simulation_.current_tick(); }
  TickTimes tick(const session::TickInputs& inputs, std::vector<Vec3f>& forces) override {
    report_ = simulation_.tick(inputs, decisions_);
    if (const auto frame = simulation_.take_frame())
      for (const auto& tool : frame->tools) forces.push_back(tool.force_n);
    const auto seconds = [&](step::Stage stage) {
      return 1e-9 * report_.stage_cpu_ns[static_cast<std::size_t>(stage)];
    };
    return {
        seconds(step::Stage::Admit) + seconds(step::Stage::Contacts), seconds(step::Stage::Queue),
        seconds(step::Stage::Solve),
        seconds(step::Stage::Claims) + seconds(step::Stage::Hash) + seconds(step::Stage::Publish)};
  }
  TickCounts counts() const override {
    return {report_.queue_nodes, report_.active_nodes, report_.contact_nodes, report_.faults};
  }
  std::span<const Vec3f> displacements() const override {
    return simulation_.state().world.displacements;
  }
  std::uint64_t state_hash() const override { return simulation_.state_hash(); }

 private:
  step::Simulation simulation_;
  step::TickDecisions decisions_;
  step::TickReport report_;
};

// The stages by themselves: graded, several threads, or every node near.
class StagesEngine final : public OurSession::Engine {
 public:
  StagesEngine(scene::Organ organ, const SessionOptions& options)
      : organ_(std::move(organ)),
        options_(options),
        world_(organ_),
        claims_(world_.node_count()),
        queue_(world_.node_count()),
        active_(world_.node_count()),
        solver_(organ_, world_, options.threads) {
    settings_ = {.sweeps = options.sweeps};
    for (std::uint32_t n = 0; n < world_.node_count(); ++n)
      if (world_.node_classes[n] != world::NodeClass::Fixed) free_nodes_.push_back(NodeIndex(n));
    if (options.mode == BoundaryMode::Graded) {
      const auto far = solver_.far_plan(kTickSeconds);
      settings_.far_sweeps = far.sweeps;
      settings_.far_over_relaxation = far.over_relaxation;
      moves_all_ = true;
    }
    moves_all_ = moves_all_ || options.is_whole;
    if (moves_all_)
      for (const auto node : free_nodes_)
        world_.node_classes[node.value] = world::NodeClass::Active;
  }

  Tick current_tick() const override { return world_.tick; }

  TickTimes tick(const session::TickInputs& inputs, std::vector<Vec3f>& forces) override {
    std::uint64_t before = thread_cpu_ns();
    const auto lap = [&] {
      const auto now = thread_cpu_ns();
      return 1e-9 * static_cast<double>(now - std::exchange(before, now));
    };
    TickTimes times;
    ++world_.tick;
    tools_.admit(inputs, world_.tick);
    contact::find_contacts(world_, tools_, claims_, grasps_, world_.tick, contacts_);
    times.init = lap();
    const auto near = choose_near();
    times.queue = lap();
    report_ = solver_.solve(contacts_, near, settings_, world_);
    if (!moves_all_) active_.freeze_quiet(queue_, solver_.residuals_n(), world_);
    times.solve = lap();
    update_claims();
    hash_ = hash_state();
    if (world_.tick % kTicksPerFrame == 0) add_forces(forces);
    times.rest = lap();
    near_count_ = near.size();
    return times;
  }

  TickCounts counts() const override {
    return {static_cast<std::uint32_t>(queue_.nodes().size()),
            static_cast<std::uint32_t>(moves_all_ ? free_nodes_.size() : near_count_),
            static_cast<std::uint32_t>(contacts_.seeds.size()),
            report_.is_stepped_down ? step::kFaultOverRelaxation : 0u};
  }
  std::span<const Vec3f> displacements() const override { return world_.displacements; }
  std::uint64_t state_hash() const override { return hash_; }

 private:
  std::span<const NodeIndex> choose_near() {
    if (options_.is_whole) return free_nodes_;
    seeds_.clear();
    for (const auto& tool : contacts_.tools) seeds_.push_back(contacts_.seeds_of(tool));
    queue_.fill(organ_.mesh.node_neighbours, seeds_, {options_.depth, options_.nodes});
    if (!moves_all_) {
      active_.collect(queue_, world_);
      return active_.nodes();
    }
    near_.clear();
    for (const auto node : queue_.nodes())
      if (world_.node_classes[node.value] != world::NodeClass::Fixed) near_.push_back(node);
    return near_;
  }

  void update_claims() {
    requests_.clear();
    for (std::uint8_t i = 0; i < kMaxTools; ++i) {
      const auto& tool = tools_[ToolSlot{i}];
      if (tool.has_sample)
        requests_.push_back(
            {ToolSlot{i}, tool.verb, tool.last_sample_tick, contacts_.reach_of(ToolSlot{i})});
    }
    events_.clear();
    claims_.update(world_.tick, requests_, events_);
    grasps_.follow_claims(world_, tools_, claims_, requests_);
  }

  void add_forces(std::vector<Vec3f>& forces) const {
    for (std::uint8_t i = 0; i < kMaxTools; ++i) {
      if (!tools_[ToolSlot{i}].has_sample) continue;
      Vec3f force;
      for (const auto& contact : contacts_.tools)
        if (contact.tool == ToolSlot{i})
          force = solver_.reaction(contacts_, contact, world_, kTickSeconds);
      forces.push_back(force);
    }
  }

  std::uint64_t hash_state() {
    hasher_.reset();
    auto archive = world::StateArchive::hashing(hasher_);
    world_.visit_state(archive);
    return hasher_.digest();
  }

  const scene::Organ organ_;
  const SessionOptions options_;
  world::World world_;
  input::ToolTable tools_;
  locks::ClaimTable claims_;
  contact::GraspTable grasps_;
  contact::ContactList contacts_;
  propagation::PropagationQueue queue_;
  propagation::ActiveSet active_;
  dynamics::BlockDescent solver_;
  dynamics::SolveSettings settings_;
  dynamics::SolveReport report_;
  bool moves_all_ = false;
  std::vector<NodeIndex> free_nodes_, near_;
  std::size_t near_count_ = 0;
  std::vector<std::span<const NodeIndex>> seeds_;
  std::vector<locks::ClaimRequest> requests_;
  std::vector<locks::ClaimEvent> events_;
  StateHasher hasher_;
  std::uint64_t hash_ = 0;
};

ToolSlot slot(std::size_t i) {
  return ToolSlot{static_cast<std::uint8_t>(i)};
}

}  // namespace

const char* name_of(BoundaryMode mode) {
  return mode == BoundaryMode::Frozen ? "frozen" : "graded";
}

OurSession::OurSession(scene::Organ organ, std::span<const BenchTool> tools,
                       const SessionOptions& options)
    : tools_(tools.begin(), tools.end()) {
  TROCAR_ASSERT(has(options.law) && options.threads <= max_threads());
  TROCAR_ASSERT(options.mode == BoundaryMode::Frozen || has_graded_mode());
  organ = with_law(std::move(organ), options.law);
  if (options.mode == BoundaryMode::Frozen && options.threads == 1 && !options.is_whole)
    engine_ = std::make_unique<SimulationEngine>(std::move(organ), options);
  else
    engine_ = std::make_unique<StagesEngine>(std::move(organ), options);
  for (std::size_t i = 0; i < tools_.size(); i += kToolsPerHand) {
    session::HandJoin join{.slot = slot(i).owner()};
    for (std::size_t k = 0; k < kToolsPerHand && i + k < tools_.size(); ++k) {
      join.shapes[k] = {
          .radius_m = tools_[i + k].radius_m, .length_m = 0.3f, .reach_m = tools_[i + k].reach_m};
      join.tool_count = static_cast<int>(k + 1);
    }
    inputs_.joins.push_back(join);
  }
}

OurSession::~OurSession() = default;

// A triangle wave between 0.4 and 1 of the amplitude, so that contact is kept, every tool at its
// own phase; reached from rest in 0.15 s, so that no impact stands above the forces that are
// compared.
void OurSession::sample_tools() {
  const Tick tick = engine_->current_tick();
  if (tick % kSampleTicks != 0) return;
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    const BenchTool& tool = tools_[i];
    const float t = static_cast<float>(tick + 37 * i) * 4e-3f;
    const float wave = 1.0f - 0.6f * std::abs(std::fmod(t, 2.0f) - 1.0f);
    const float moved =
        tool.amplitude_m * wave * std::min(1.0f, static_cast<float>(tick) / kRampTicks);
    const float out = tool.grasps ? moved : -moved;
    inputs_.samples.push_back({slot(i),
                               {{tool.place + tool.outward * out, rotation_from_z(tool.outward)},
                                tool.grasps ? scene::Verb::Grasp : scene::Verb::Push}});
  }
}

TickTimes OurSession::tick() {
  sample_tools();
  const auto times = engine_->tick(inputs_, forces_);
  inputs_.clear();
  return times;
}

}  // namespace trocar::bench
