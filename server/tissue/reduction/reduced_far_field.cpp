// Why a reduction that is local, and how a step goes.
//
// A tool deforms tissue near it sharply and the rest smoothly. Near nodes are swept as they are;
// the rest is taken to be u = Phi q, with some dozens of fields Phi that were made from presses
// there (server/lab/reduce; modes of Karhunen and Loeve as in Dogan 2011). Putting u into the
// step's potential and asking for its minimum over q (Galerkin's projection) gives, per correction,
//   (a Phi^T M Phi + K_outer + K_inner + K_touch) dq
//       = -Phi^T (M acc + f_inner(u)) - K_outer q + Phi^T f_relaxed - fade c,
//   a = (1/dt + drag)/dt.
// The tets around the patch (inner) give their true forces f_inner, also those of swept nodes; the
// others (outer) respond as at rest, K_outer q, so that a step costs nothing for them. The matrix
// on the left needs no more than to be near the tangent: K_inner is that at rest, because
// corrections are repeated in every tick.
//
// What makes it continuous. When fields take over, the tissue is not in their span, nor do its
// forces balance there: u - Phi q and the force c that K_outer q lacks are kept, and fade within
// kFade_s. Momentum goes along the fields, M Phi rates = Phi^T M v. When they hand back, nodes have
// the velocities of the fields alone: what fades is no motion, and a solver that went on with it
// would gain energy at each hand-over.
//
// What keeps it honest. The residual at the patch's rim, where forces are known but nodes do not
// move on their own, is an energy that the fields can't remove; its ratio to the work done is the
// estimate that is shown to people (estimate_error()).

#include "server/tissue/reduction/reduced_far_field.h"

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"
#include "common/base/tick.h"
#include "server/tissue/contact/contact_law.h"

namespace trocar::reduction {
namespace {

// Below this the correction is nothing.
constexpr double kLeastFade = 1e-4;
// Steps from one estimate of the error to the next.
constexpr std::uint32_t kEstimateInterval = 4;
// An error does not count where fields and contacts do less work than this.
constexpr double kLeastWork_j = 1e-5;
// No amplitude, the square root of an energy in J, may change by more than this in one correction.
// More is as broken as what is not finite: nothing is changed, and the estimate says so until
// patches take over again.
constexpr double kMaxChange = 100;
constexpr float kBroken = 1e6f;
// This is added to the stiffness of every field, which is 1.
constexpr double kLeastStiffness = 1e-9;
// The solver by blocks makes so many passes when patches take over.
constexpr int kPasses = 20;

}  // namespace

ReducedFarField::ReducedFarField(const LocalModels& models)
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

void ReducedFarField::use(ReducedFarState& state, const PatchModel* model) {
  TROCAR_ASSERT(state.acts() == (model != nullptr));
  state_ = &state;
  if (model != model_) set_model(model);
}

void ReducedFarField::set_model(const PatchModel* model) {
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

void ReducedFarField::take_over(const PatchSet& patches, const PatchModel& model,
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

  // First come the forces with which the organ resists along the fields, then the amplitudes at
  // which the fields would resist as much.
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

void ReducedFarField::hand_back(world::World& world) {
  auto& s = *state_;
  if (!s.acts()) return;
  for (std::uint32_t turn = 0; turn < kPlacingTurns; ++turn)
    place(turn, nullptr, nullptr, static_cast<double>(kTickSeconds), world);
  keep_rates(world);
  s.end();
  set_model(nullptr);
}

void ReducedFarField::near_of(std::span<const NodeIndex> active,
                              std::vector<NodeIndex>& near) const {
  near.clear();
  for (const auto node : active) {
    const auto local = node.value < node_count_ && is_local_[node.value] != 0 ? model_->local(node)
                                                                              : PatchModel::kNone;
    if (local != PatchModel::kNone && model_->may_be_free(local)) near.push_back(node);
  }
}

void ReducedFarField::gather(const dynamics::FarFieldStep& step) {
  for (std::size_t n = 0; n < slots_.size(); ++n) {
    const auto& x = step.x[slots_[n]];
    u_[3 * n] = x.x, u_[3 * n + 1] = x.y, u_[3 * n + 2] = x.z;
  }
}

void ReducedFarField::begin(const dynamics::FarFieldStep& step) {
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
void ReducedFarField::add_contacts(const dynamics::FarFieldStep& step) {
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

// Returns the sum of the fields at a local node, weighted by change_.
Vec3f ReducedFarField::of_change(std::uint32_t local) const {
  const auto basis = model_->basis();
  std::array<float, 3> sum{};
  add_fields({basis.values.subspan(3 * local * basis.stride), basis.stride}, change_, sum);
  return {sum[0], sum[1], sum[2]};
}

// Adds the inertia and drag of near nodes that the fields do not have. ahead_ has the accelerations
// of the fields with their drag, in amplitudes per s^2.
void ReducedFarField::add_inertia(const dynamics::FarFieldStep& step) {
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
bool ReducedFarField::make_factors(double inertia_per_s2) {
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

void ReducedFarField::correct(const dynamics::FarFieldStep& step) {
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
void ReducedFarField::fit_to_near(const dynamics::FarFieldStep& step) {
  if (near_.empty()) return;
  auto& s = *state_;
  const auto* const near_fit = model_->near_fit();
  if (near_fit == nullptr) {
    s.estimate = kBroken;
    return;
  }
  gather(step);
  const auto count = model_->field_count();
  const auto fit = [&](std::vector<double>& values, auto&& wanted) {
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
  fit(s.amplitudes, at);
  fit(s.rates, [&](std::size_t i) {
    return (at(i) - step.world.displacements[step.near[i].value]) * inverse_dt;
  });
}

float ReducedFarField::estimate_error(const dynamics::FarFieldStep& step,
                                      const world::World& world) {
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

float ReducedFarField::end(const dynamics::FarFieldStep& step, dynamics::Float4* velocities,
                           world::World& world) {
  auto& s = *state_;
  const auto& model = *model_;
  const auto count = model.field_count();
  const double dt = static_cast<double>(step.dt);
  for (std::size_t c = 0; c < count; ++c) s.rates[c] = (s.amplitudes[c] - start_[c]) / dt;
  fit_to_near(step);
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

}  // namespace trocar::reduction
