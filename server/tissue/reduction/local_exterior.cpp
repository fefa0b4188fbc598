#include "server/tissue/reduction/local_exterior.h"

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"
#include "common/base/tick.h"
#include "server/tissue/contact/contact_law.h"

namespace trocar::reduction {
namespace {

// In which what the fields do not have fades, of places and of forces.
constexpr double kFade_s = 0.05;
// Below this the correction is nothing.
constexpr double kLeastFade = 1e-4;
// Steps from one estimate of the error to the next.
constexpr std::uint32_t kEstimateInterval = 4;
// Of touches, J: with less an error is not worth a word.
constexpr double kLeastWork_j = 1e-5;
// Of an amplitude in one correction; the square root of an energy in J. More is as broken as what
// is not finite: nothing is changed, and the estimate says so until the next.
constexpr double kMaxChange = 100;
constexpr float kBroken = 1e6f;
// Beside 1 of every field.
constexpr double kLeastStiffness = 1e-9;
// Of the solver by blocks, when patches take over.
constexpr int kPasses = 20;

}  // namespace

LocalExterior::LocalExterior(const LocalModels& models)
    : node_count_(models.node_count()),
      drag_per_s_(models.drag_per_s()),
      is_local_(models.node_count()) {
  std::size_t fields = 0, nodes = 0;
  for (std::uint32_t p = 0; p < models.size(); ++p) {
    fields = std::max(fields, models[p].stride());
    nodes = std::max(nodes, models[p].nodes().size());
  }
  for (auto* values : {&start_, &ahead_, &gradient_, &scratch_}) values->reserve(fields);
  for (auto* values : {&along_, &change_}) values->reserve(fields);
  for (auto* values : {&u_, &f_, &moved_}) values->reserve(3 * nodes);
  slots_.reserve(nodes);
  is_near_.reserve(nodes);
  near_.reserve(nodes);
  touched_.reserve(contact::kMaxPointNodes * 64);
  momentum_.reserve(node_count_);
  gathered_.resize(3 * node_count_);
  run_.resize(3 * (node_count_ / kPlacingTurns + 1));
}

void LocalExterior::use(ExteriorState& state, const PatchModel* model) {
  TROCAR_ASSERT(state.acts() == (model != nullptr));
  state_ = &state;
  if (model != model_) set_model(model);
}

void LocalExterior::set_model(const PatchModel* model) {
  if (model_ != nullptr)
    for (const auto node : model_->nodes()) is_local_[node.value] = 0;
  model_ = model;
  if (model == nullptr) return;
  for (const auto node : model->nodes()) is_local_[node.value] = 1;
  const auto width = model->stride();
  for (auto* values : {&start_, &ahead_, &gradient_, &scratch_}) values->assign(width, 0);
  for (auto* values : {&along_, &change_}) values->assign(width, 0);
  for (auto* values : {&u_, &f_, &moved_}) values->assign(3 * model->nodes().size(), 0);
  is_near_.assign(model->nodes().size(), 0);
  near_.clear();
  system_.clear_links();
  system_.resize(model->blocks());
}

void LocalExterior::follow_cuts(const world::World& world) {
  if (follower_count() == world.origins.size()) return;
  share_begins_.assign(1, 0);
  shares_.clear();
  const auto add = [&](NodeIndex node, float weight, std::size_t own) {
    if (weight == 0) return;
    const auto put = [&](std::uint32_t root, float part) {
      const auto mine = std::span(shares_).subspan(own);
      const auto found = std::ranges::find(mine, root, &Share::node);
      if (found != mine.end())
        found->weight += part;
      else
        shares_.push_back({root, part});
    };
    if (node.value < node_count_) return put(node.value, weight);
    const auto parent = node.value - node_count_;
    for (auto i = share_begins_[parent]; i < share_begins_[parent + 1]; ++i)
      put(shares_[i].node, weight * shares_[i].weight);
  };
  for (const auto& origin : world.origins) {
    const auto own = shares_.size();
    const float t = static_cast<float>(origin.t) / 65536.0f;
    add(origin.a, 1 - t, own);
    add(origin.b, t, own);
    share_begins_.push_back(static_cast<std::uint32_t>(shares_.size()));
  }
}

std::span<const float> LocalExterior::gathered(std::span<const Vec3f> values, std::size_t begin,
                                               std::size_t end) {
  for (std::size_t n = begin; n < end; ++n) {
    float* const to = &gathered_[3 * (n - begin)];
    to[0] = values[n].x, to[1] = values[n].y, to[2] = values[n].z;
  }
  for (std::size_t i = 0; i < follower_count(); ++i)
    for (const auto& [node, weight] : shares_of(i)) {
      if (node < begin || node >= end) continue;
      const Vec3f part = values[node_count_ + i] * weight;
      float* const to = &gathered_[3 * (node - begin)];
      to[0] += part.x, to[1] += part.y, to[2] += part.z;
    }
  return std::span(gathered_).first(3 * (end - begin));
}

void LocalExterior::take_over(const PatchSet& patches, const PatchModel& model,
                              std::span<const Vec3f> gradient, const world::World& world) {
  auto& s = *state_;
  set_model(&model);
  const auto count = model_->field_count(), width = model_->stride();
  s.patches = patches;
  s.age = 0;
  s.estimate = 0;
  s.fade = 1;
  for (auto* values : {&s.amplitudes, &s.rates, &s.correction, &s.relaxed, &s.relaxed_next})
    values->assign(count, 0);

  // What the organ resists with along the fields, and what these would have to do so.
  const auto along = [&](std::span<const float> values, std::vector<double>& out) {
    std::ranges::fill(along_, 0.0f);
    model_->add_along_everywhere(0, node_count_, values, along_);
    for (std::size_t c = 0; c < count; ++c) out[c] = static_cast<double>(along_[c]);
  };
  along(gathered(gradient, 0, node_count_), s.correction);
  system_.clear_links();
  const auto fill = [&](double stiffness, double mass) {
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t j = 0; j < count; ++j) {
        const auto at = i * width + j;
        system_.row(i)[j] =
            stiffness * (model_->outer_stiffness()[at] + model_->inner_stiffness()[at]) +
            mass * model_->mass()[at] + (i == j ? stiffness * kLeastStiffness : 0);
      }
  };
  fill(1, 0);
  s.amplitudes = s.correction;
  if (system_.factor())
    system_.solve(s.amplitudes, solving_, kPasses);
  else
    std::ranges::fill(s.amplitudes, 0.0);

  for (std::size_t n = 0; n < model_->nodes().size(); ++n) {
    const Vec3f& d = world.displacements[model_->nodes()[n].value];
    u_[3 * n] = d.x, u_[3 * n + 1] = d.y, u_[3 * n + 2] = d.z;
  }
  std::ranges::fill(f_, 0.0f);
  model_->inner().add_forces(ForcePart::Whole, u_, f_);
  std::ranges::fill(along_, 0.0f);
  add_along_fields(model_->basis(), f_, along_);
  std::ranges::fill(scratch_, 0.0);
  add_product(model_->outer_stiffness(), width, s.amplitudes, std::span(scratch_).first(count));
  for (std::size_t c = 0; c < count; ++c)
    s.correction[c] -= static_cast<double>(along_[c]) + scratch_[c];

  // Rates that have the momentum along the fields.
  momentum_.resize(world.node_count());
  for (std::size_t n = 0; n < world.node_count(); ++n)
    momentum_[n] = world.velocities[n] * world.masses[n];
  along(gathered(momentum_, 0, node_count_), s.rates);
  constexpr auto kStep = static_cast<double>(kTickSeconds);
  fill(kStep * kStep, 1);
  if (system_.factor())
    system_.solve(s.rates, solving_, kPasses);
  else
    std::ranges::fill(s.rates, 0.0);

  if (!world.relaxation.is_empty())
    along(gathered(world.relaxation.forces(), 0, node_count_), s.relaxed);
  s.placed.clear();
  for (std::uint32_t turn = 0; turn < kPlacingTurns; ++turn)
    s.placed.insert(s.placed.end(), s.amplitudes.begin(), s.amplitudes.end());
  s.steps_since_placed.assign(kPlacingTurns, 0);
}

void LocalExterior::hand_back(world::World& world) {
  auto& s = *state_;
  if (!s.acts()) return;
  for (std::uint32_t turn = 0; turn < kPlacingTurns; ++turn)
    place(turn, nullptr, nullptr, static_cast<double>(kTickSeconds), world);
  keep_rates(world);
  s.end();
  set_model(nullptr);
}

// Far nodes move on as the fields do. What they were not in has faded, which is no motion that
// another solver may go on with: it would gain energy at every hand-over.
void LocalExterior::keep_rates(world::World& world) {
  const auto count = model_->field_count();
  for (std::size_t c = 0; c < count; ++c) change_[c] = static_cast<float>(state_->rates[c]);
  for (std::uint32_t turn = 0; turn < kPlacingTurns; ++turn) {
    const auto begin = node_count_ * turn / kPlacingTurns,
               end = node_count_ * (turn + 1) / kPlacingTurns;
    const auto run = std::span(run_).first(3 * (end - begin));
    std::ranges::fill(run, 0.0f);
    model_->add_everywhere(begin, end, change_, run);
    for (std::size_t n = begin; n < end; ++n)
      if (is_local_[n] == 0 && world.node_classes[n] != world::NodeClass::Fixed)
        world.velocities[n] = {run[3 * (n - begin)], run[3 * (n - begin) + 1],
                               run[3 * (n - begin) + 2]};
  }
  for (std::size_t i = 0; i < follower_count(); ++i) {
    Vec3f velocity;
    for (const auto& [node, weight] : shares_of(i)) velocity += world.velocities[node] * weight;
    if (world.node_classes[node_count_ + i] != world::NodeClass::Fixed)
      world.velocities[node_count_ + i] = velocity;
  }
}

void LocalExterior::near_of(std::span<const NodeIndex> active, std::vector<NodeIndex>& near) const {
  near.clear();
  for (const auto node : active) {
    const auto local = node.value < node_count_ && is_local_[node.value] != 0 ? model_->local(node)
                                                                              : PatchModel::kNone;
    if (local != PatchModel::kNone && model_->may_be_free(local)) near.push_back(node);
  }
}

void LocalExterior::gather(const dynamics::ExteriorStep& step) {
  for (std::size_t n = 0; n < slots_.size(); ++n) {
    const auto& x = step.x[slots_[n]];
    u_[3 * n] = x.x, u_[3 * n + 1] = x.y, u_[3 * n + 2] = x.z;
  }
}

void LocalExterior::begin(const dynamics::ExteriorStep& step) {
  auto& s = *state_;
  const auto& model = *model_;
  const auto count = model.field_count();
  has_factors_ = false;
  slots_.clear();
  for (const auto node : model.nodes()) slots_.push_back(step.groups.slot_of(node));
  for (const auto local : near_) is_near_[local] = 0;
  near_.clear();
  for (const auto node : step.near) {
    near_.push_back(model.local(node));
    is_near_[near_.back()] = 1;
  }
  const double dt = static_cast<double>(step.dt);
  const double stays = 1 - dt / kFade_s;
  for (std::size_t c = 0; c < count; ++c) {
    start_[c] = s.amplitudes[c];
    s.amplitudes[c] += dt * s.rates[c];
    change_[c] = static_cast<float>(s.amplitudes[c] - stays * start_[c]);
  }
  std::ranges::fill(moved_, 0.0f);
  add_fields(model.basis(), change_, moved_);
  const auto left = static_cast<float>(stays);
  for (std::size_t n = 0; n < slots_.size(); ++n) {
    if (is_near_[n] != 0) continue;
    auto& x = step.x[slots_[n]];
    x.x = x.x * left + moved_[3 * n];
    x.y = x.y * left + moved_[3 * n + 1];
    x.z = x.z * left + moved_[3 * n + 2];
  }
}

// Contacts among local nodes: forces on them, and their stiffness.
void LocalExterior::add_contacts(const dynamics::ExteriorStep& step) {
  touched_.clear();
  contact_work_j_ = 0;
  for (const auto& point : step.contacts.points) {
    std::array<std::uint32_t, contact::kMaxPointNodes> local{};
    Vec3f d;
    bool is_here = true;
    for (std::size_t k = 0; k < point.node_count && is_here; ++k) {
      const auto node = point.nodes[k];
      is_here = node.value < node_count_ && is_local_[node.value] != 0;
      if (!is_here) break;
      local[k] = model_->local(node);
      d += Vec3f{u_[3 * local[k]], u_[3 * local[k] + 1], u_[3 * local[k] + 2]} * point.weights[k];
    }
    if (!is_here) continue;
    const auto load = contact::load_at(point, d);
    if (load.pressed_n == 0 && load.tangential_secant == 0) continue;
    for (std::size_t k = 0; k < point.node_count; ++k) {
      if ((point.moved >> k & 1) == 0) continue;
      const float weight = point.weights[k];
      const Vec3f force = load.gradient * weight;
      float* const f = &f_[3 * local[k]];
      f[0] += force.x, f[1] += force.y, f[2] += force.z;
      const float* const u = &u_[3 * local[k]];
      contact_work_j_ -= static_cast<double>(force.x * u[0] + force.y * u[1] + force.z * u[2]);
      auto found = std::ranges::find(touched_, local[k], &Touched::local);
      if (found == touched_.end()) found = touched_.insert(touched_.end(), {local[k], {}});
      // All of a point's stiffness on its nodes' own blocks: at least what it is.
      const float share = std::abs(weight);
      found->block.add_identity(share * load.tangential_secant);
      if (point.kind == contact::ContactPoint::Kind::Push && load.pressed_n > 0)
        found->block.add_outer(point.normal, share * (load.normal_secant - load.tangential_secant));
    }
  }
}

// Of fields with the factors of change_, at a local node.
Vec3f LocalExterior::of_change(std::uint32_t local) const {
  const auto basis = model_->basis();
  std::array<float, 3> sum{};
  add_fields({basis.values.subspan(3 * local * basis.stride), basis.stride}, change_, sum);
  return {sum[0], sum[1], sum[2]};
}

// Of near nodes, what theirs is besides that of the fields; ahead_: accelerations of the fields
// with their drag, per s^2.
void LocalExterior::add_inertia(const dynamics::ExteriorStep& step) {
  const float inverse_dt = 1 / step.dt, drag = static_cast<float>(drag_per_s_);
  for (std::size_t c = 0; c < change_.size(); ++c) change_[c] = static_cast<float>(ahead_[c]);
  for (std::size_t i = 0; i < near_.size(); ++i) {
    const auto local = near_[i];
    const auto node = step.near[i];
    const Vec3f u{u_[3 * local], u_[3 * local + 1], u_[3 * local + 2]};
    const Vec3f moved = u - step.world.displacements[node.value];
    const Vec3f own =
        ((moved * inverse_dt - step.world.velocities[node.value]) + moved * drag) * inverse_dt;
    const Vec3f of_fields = of_change(local);
    const float mass = model_->masses()[local];
    f_[3 * local] += mass * (own.x - of_fields.x);
    f_[3 * local + 1] += mass * (own.y - of_fields.y);
    f_[3 * local + 2] += mass * (own.z - of_fields.z);
  }
}

// For all corrections of a step: stiffness of contacts is that of the first.
bool LocalExterior::make_factors(double inertia_per_s2) {
  const auto& model = *model_;
  const auto count = model.field_count(), width = model.stride();
  const auto mass = model.mass(), outer = model.outer_stiffness(), inner = model.inner_stiffness();
  for (std::size_t i = 0; i < count; ++i) {
    double* const row = system_.row(i);
    const auto at = i * width;
    for (std::size_t j = 0; j < count; ++j)
      row[j] = mass[at + j] * inertia_per_s2 + outer[at + j] + inner[at + j];
  }
  system_.clear_links();
  const auto basis = model.basis();
  for (const auto& [local, block] : touched_)
    system_.add_link({basis.row(3 * local), basis.row(3 * local + 1), basis.row(3 * local + 2)},
                     block);
  return system_.factor();
}

void LocalExterior::correct(const dynamics::ExteriorStep& step) {
  auto& s = *state_;
  const auto& model = *model_;
  const auto count = model.field_count(), width = model.stride();
  const double dt = static_cast<double>(step.dt);
  const double inertia = (1 / dt + drag_per_s_) / dt;
  for (std::size_t c = 0; c < count; ++c) {
    const double moved = s.amplitudes[c] - start_[c];
    ahead_[c] = moved * inertia - s.rates[c] / dt;
  }
  gather(step);
  std::ranges::fill(f_, 0.0f);
  model.inner().add_forces(ForcePart::Whole, u_, f_);
  add_inertia(step);
  add_contacts(step);
  std::ranges::fill(along_, 0.0f);
  add_along_fields(model.basis(), f_, along_);
  for (std::size_t c = 0; c < count; ++c)
    gradient_[c] = static_cast<double>(along_[c]) - s.relaxed[c] + s.fade * s.correction[c];
  const auto gradient = std::span(gradient_).first(count);
  const auto outer = std::span(scratch_).first(count);
  std::ranges::fill(outer, 0.0);
  add_product(model.outer_stiffness(), width, s.amplitudes, outer);
  field_work_j_ = 0;
  for (std::size_t c = 0; c < count; ++c) {
    gradient[c] += outer[c];
    field_work_j_ += outer[c] * s.amplitudes[c];
  }
  add_product(model.mass(), width, std::span(ahead_).first(count), gradient);
  if (!has_factors_) has_factors_ = make_factors(inertia);
  if (has_factors_)
    system_.solve(gradient, solving_);
  else
    gradient[0] = NAN;
  if (!std::ranges::all_of(gradient, [](double g) { return std::abs(g) < kMaxChange; })) {
    s.estimate = kBroken;
    return;
  }
  for (std::size_t c = 0; c < count; ++c) {
    s.amplitudes[c] -= gradient[c];
    change_[c] = static_cast<float>(-gradient[c]);
  }
  std::ranges::fill(moved_, 0.0f);
  add_fields(model.basis(), change_, moved_);
  for (std::size_t n = 0; n < slots_.size(); ++n) {
    auto& x = step.x[slots_[n]];
    x.x += moved_[3 * n], x.y += moved_[3 * n + 1], x.z += moved_[3 * n + 2];
  }
}

// Near nodes are swept, and moved by the fields. What sweeps undo of that in every step would build
// up, without bound, in fields that move hardly anything else, and come out when the nodes are near
// no more: so the fields follow the near nodes where that moves nothing else.
void LocalExterior::follow_near(const dynamics::ExteriorStep& step) {
  if (near_.empty()) return;
  auto& s = *state_;
  const auto* const near_fit = model_->near_fit();
  if (near_fit == nullptr) {
    s.estimate = kBroken;
    return;
  }
  gather(step);
  const auto count = model_->field_count();
  const auto follow = [&](std::vector<double>& values, auto&& wanted) {
    for (std::size_t c = 0; c < count; ++c) change_[c] = static_cast<float>(values[c]);
    std::ranges::fill(f_, 0.0f);
    for (std::size_t i = 0; i < near_.size(); ++i) {
      const auto local = near_[i];
      const Vec3f left = (wanted(i) - of_change(local)) * model_->masses()[local];
      f_[3 * local] = left.x, f_[3 * local + 1] = left.y, f_[3 * local + 2] = left.z;
    }
    std::ranges::fill(along_, 0.0f);
    add_along_fields(model_->basis(), f_, along_);
    const auto change = std::span(scratch_).first(count);
    for (std::size_t c = 0; c < count; ++c) change[c] = static_cast<double>(along_[c]);
    near_fit->solve(change, solving_);
    for (std::size_t c = 0; c < count; ++c) values[c] += change[c];
  };
  const auto at = [&](std::size_t i) {
    const float* const u = &u_[3 * near_[i]];
    return Vec3f{u[0], u[1], u[2]};
  };
  const float inverse_dt = 1 / step.dt;
  follow(s.amplitudes, at);
  follow(s.rates, [&](std::size_t i) {
    return (at(i) - step.world.displacements[step.near[i].value]) * inverse_dt;
  });
}

float LocalExterior::estimate_error(const dynamics::ExteriorStep& step, const world::World& world) {
  const auto& model = *model_;
  gather(step);
  std::ranges::fill(f_, 0.0f);
  model.inner().add_forces(ForcePart::Whole, u_, f_);
  model.beyond_rim().add_forces(ForcePart::Whole, u_, f_);
  const auto relaxed = world.relaxation.forces();
  const float inverse_dt = 1 / step.dt, drag = static_cast<float>(drag_per_s_);
  double energy = 0;
  for (std::size_t i = 0; i < model.rim().size(); ++i) {
    const auto local = model.rim()[i];
    const auto node = model.nodes()[local].value;
    Vec3f left{f_[3 * local], f_[3 * local + 1], f_[3 * local + 2]};
    // The world's velocities are still those before the step.
    const Vec3f u{u_[3 * local], u_[3 * local + 1], u_[3 * local + 2]};
    const Vec3f now = (u - world.displacements[node]) * inverse_dt;
    left += ((now - world.velocities[node]) * inverse_dt + now * drag) * model.masses()[local];
    if (!relaxed.empty()) left -= relaxed[node];
    energy += static_cast<double>(length_squared(left) / model.rim_stiffness()[i]);
  }
  const auto estimate = static_cast<float>(
      std::sqrt(energy / (std::max(field_work_j_, contact_work_j_) + kLeastWork_j)));
  return estimate < kBroken ? estimate : kBroken;  // finite: it is part of the state
}

float LocalExterior::end(const dynamics::ExteriorStep& step, dynamics::Float4* velocities,
                         world::World& world) {
  auto& s = *state_;
  const auto& model = *model_;
  const auto count = model.field_count();
  const double dt = static_cast<double>(step.dt);
  for (std::size_t c = 0; c < count; ++c) s.rates[c] = (s.amplitudes[c] - start_[c]) / dt;
  follow_near(step);
  s.fade *= 1 - dt / kFade_s;
  if (s.fade < kLeastFade) s.fade = 0;
  if (s.age % kEstimateInterval == 0 && s.estimate < kBroken)
    s.estimate = estimate_error(step, world);
  float squared = 0;
  const float inverse_dt = 1 / step.dt;
  for (std::size_t n = 0; n < slots_.size(); ++n) {
    if (is_near_[n] != 0) continue;
    const auto node = model.nodes()[n];
    if (world.node_classes[node.value] == world::NodeClass::Fixed) continue;
    const Vec3f now = dynamics::to_vec3(step.x[slots_[n]]);
    const Vec3f move = now - world.displacements[node.value];
    squared = std::max(squared, length_squared(move));
    world.displacements[node.value] = now;
    world.velocities[node.value] = move * inverse_dt;
    velocities[slots_[n]] = dynamics::to_float4(world.velocities[node.value]);
  }
  for (auto& steps : s.steps_since_placed) ++steps;
  const auto turn = s.age % kPlacingTurns;
  squared = std::max(squared, place(turn, &step, velocities, dt, world));
  if (!world.relaxation.is_empty()) {
    const auto begin = node_count_ * turn / kPlacingTurns,
               end = node_count_ * (turn + 1) / kPlacingTurns;
    std::ranges::fill(along_, 0.0f);
    model.add_along_everywhere(begin, end, gathered(world.relaxation.forces(), begin, end), along_);
    for (std::size_t c = 0; c < count; ++c) s.relaxed_next[c] += static_cast<double>(along_[c]);
    if (turn + 1 == kPlacingTurns) {
      s.relaxed = s.relaxed_next;
      std::ranges::fill(s.relaxed_next, 0.0);
    }
  }
  ++s.age;
  return std::sqrt(squared);
}

// Nodes of one turn where the fields have them, or will have them halfway to their next turn, so
// that they are not late on average; the squared move of the farthest. step: null: it is for the
// world alone, and now.
float LocalExterior::place(std::uint32_t turn, const dynamics::ExteriorStep* step,
                           dynamics::Float4* velocities, double dt, world::World& world) {
  auto& s = *state_;
  const auto count = model_->field_count();
  const auto begin = node_count_ * turn / kPlacingTurns,
             end = node_count_ * (turn + 1) / kPlacingTurns;
  const auto steps = s.steps_since_placed[turn];
  double stays = 1;
  for (int step_count = 0; step_count < steps; ++step_count) stays *= 1 - dt / kFade_s;
  double* const placed = s.placed.data() + turn * count;
  const double ahead = step != nullptr ? dt * (kPlacingTurns - 1) / 2 : 0;
  for (std::size_t c = 0; c < count; ++c) {
    const double to = s.amplitudes[c] + ahead * s.rates[c];
    change_[c] = static_cast<float>(to - stays * placed[c]);
    placed[c] = to;
  }
  s.steps_since_placed[turn] = 0;
  const auto run = std::span(run_).first(3 * (end - begin));
  std::ranges::fill(run, 0.0f);
  model_->add_everywhere(begin, end, change_, run);
  const auto left = static_cast<float>(stays);
  const float inverse_time =
      1 / (static_cast<float>(dt) * static_cast<float>(std::max<int>(steps, 1)));
  float squared = 0;
  for (std::size_t n = begin; n < end; ++n) {
    float* const moved = &run[3 * (n - begin)];
    if (is_local_[n] != 0 || world.node_classes[n] == world::NodeClass::Fixed) {
      std::fill_n(moved, 3, 0.0f);
      continue;
    }
    Vec3f& displacement = world.displacements[n];
    const Vec3f now = displacement * left + Vec3f{moved[0], moved[1], moved[2]};
    const Vec3f move = now - displacement;
    squared = std::max(squared, length_squared(move));
    displacement = now;
    world.velocities[n] = move * inverse_time;
    moved[0] = move.x, moved[1] = move.y, moved[2] = move.z;
    if (step == nullptr) continue;
    const auto slot = step->groups.slot_of(NodeIndex(static_cast<std::uint32_t>(n)));
    if (slot == dynamics::kNoSlot) continue;
    step->x[slot] = dynamics::to_float4(now);
    velocities[slot] = dynamics::to_float4(world.velocities[n]);
  }
  place_followers(begin, end, step, velocities, world);
  return squared;
}

// Nodes that cuts made move by their shares of what the organ's nodes of this turn have moved by.
void LocalExterior::place_followers(std::size_t begin, std::size_t end,
                                    const dynamics::ExteriorStep* step,
                                    dynamics::Float4* velocities, world::World& world) {
  for (std::size_t i = 0; i < follower_count(); ++i) {
    const auto n = node_count_ + i;
    if (world.node_classes[n] == world::NodeClass::Fixed) continue;
    Vec3f moved, velocity;
    bool is_moved = false;
    for (const auto& [node, weight] : shares_of(i)) {
      velocity += world.velocities[node] * weight;
      if (node < begin || node >= end) continue;
      const float* const move = &run_[3 * (node - begin)];
      moved += Vec3f{move[0], move[1], move[2]} * weight;
      is_moved = true;
    }
    if (!is_moved) continue;
    world.displacements[n] += moved;
    world.velocities[n] = velocity;
    if (step == nullptr) continue;
    const auto slot = step->groups.slot_of(NodeIndex(static_cast<std::uint32_t>(n)));
    if (slot == dynamics::kNoSlot) continue;
    step->x[slot] = dynamics::to_float4(world.displacements[n]);
    velocities[slot] = dynamics::to_float4(velocity);
  }
}

}  // namespace trocar::reduction
