#include "server/tissue/dynamics/linearisation.h"

#include <bit>

#include "common/base/assert.h"
#include "server/tissue/dynamics/room.h"

namespace trocar::dynamics {
namespace {

// Largest halves are about this: room above for nothing, below for 28 bits of smaller ones.
constexpr int kLargestExponent = 14;

void to_halves(std::array<std::uint16_t, kLanes>& halves, Float8 v) {
  _mm_storeu_si128(reinterpret_cast<__m128i*>(halves.data()),
                   _mm256_cvtps_ph(v, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC));
}

float power_of_two(int exponent) {
  return std::bit_cast<float>(static_cast<std::uint32_t>(exponent + 127) << 23);
}
// Returns the exponent of the leading bit of a positive normal number.
int exponent_of(float v) {
  return static_cast<int>(std::bit_cast<std::uint32_t>(v) >> 23 & 0xff) - 127;
}

}  // namespace

class Linearisation::Summing final : public StiffnessSink {
 public:
  Summing(std::span<const Targets> targets, std::vector<std::array<Lanes, 9>>& rows)
      : next_(targets.data()), rows_(rows) {}

  void add(const SlotLanes&, const Mat8& stiffness) override { add(*next_++, stiffness, rows_); }
  static void add(const Targets& targets, const Mat8& stiffness,
                  std::vector<std::array<Lanes, 9>>& rows);

 private:
  const Targets* next_;
  std::vector<std::array<Lanes, 9>>& rows_;
};

void Linearisation::Summing::add(const Targets& targets, const Mat8& stiffness,
                                 std::vector<std::array<Lanes, 9>>& rows) {
  std::array<Lanes, 9> terms;
  const std::array<const Vec8*, 3> lines{&stiffness.x, &stiffness.y, &stiffness.z};
  for (std::size_t i = 0; i < 3; ++i) {
    store(terms[3 * i], lines[i]->x);
    store(terms[3 * i + 1], lines[i]->y);
    store(terms[3 * i + 2], lines[i]->z);
  }
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    if (targets[lane] == kNoRow) continue;
    auto& row = rows[targets[lane]];
    for (std::size_t i = 0; i < 9; ++i) row[i].v[lane] += terms[i].v[lane];
  }
}

// Learns the distinct neighbours of each lane and which call is for which, and sums as Summing.
class Linearisation::Indexing final : public StiffnessSink {
 public:
  void begin(Group group) {
    first_ = static_cast<Slot>(group * kLanes);
    for (auto& list : neighbours) list.clear();
    calls.clear();
    rows.clear();
  }

  void add(const SlotLanes& others, const Mat8& stiffness) override {
    Targets targets{};
    for (std::uint32_t lane = 0; lane < kLanes; ++lane) {
      targets[lane] = kNoRow;
      if (others.v[lane] == first_ + lane) continue;
      auto& list = neighbours[lane];
      std::size_t at = 0;
      while (at < list.size() && list[at] != others.v[lane]) ++at;
      if (at == list.size()) list.push_back(others.v[lane]);
      if (at == rows.size()) rows.emplace_back();
      TROCAR_ASSERT(at < kNoRow);
      targets[lane] = static_cast<std::uint8_t>(at);
    }
    calls.push_back(targets);
    Summing::add(targets, stiffness, rows);
  }

  std::array<std::vector<Slot>, kLanes> neighbours;
  std::vector<Targets> calls;
  std::vector<std::array<Lanes, 9>> rows;

 private:
  Slot first_ = 0;
};

Linearisation::~Linearisation() = default;

Linearisation::Linearisation(const Tissue& tissue)
    : tissue_(tissue), indexing_(std::make_unique<Indexing>()) {
  const std::vector<Float4> rest(tissue.groups().slot_count());
  nodes_.reserve(with_room(tissue.groups().group_count()));
  for (Group g = 0; g < tissue.groups().group_count(); ++g) index(g, rest.data());
  rows_.end_building();
  targets_.end_building();
}

void Linearisation::index(Group group, const Float4* pose) {
  const auto count = tissue_.groups().group_count();
  nodes_.resize(count);
  rows_.extend(count);
  targets_.extend(count);
  Indexing& found = *indexing_;
  found.begin(group);
  NodeStep8 step{zero_vec8(), zero_sym_mat8()};
  tissue_.linearise(group, pose, load_group(pose + group * kLanes), step, found);

  std::size_t most = 0;
  for (const auto& list : found.neighbours) most = std::max(most, list.size());
  const auto rows = rows_.resize(group, static_cast<std::uint32_t>(most));
  for (std::size_t i = 0; i < most; ++i) {
    rows[i] = Row{};
    for (std::uint32_t lane = 0; lane < kLanes; ++lane) {
      const auto& list = found.neighbours[lane];
      rows[i].neighbour.v[lane] = i < list.size() ? list[i] : group * kLanes + lane;
    }
  }
  const auto targets = targets_.resize(group, static_cast<std::uint32_t>(found.calls.size()));
  std::ranges::copy(found.calls, targets.begin());
  take(group, found.rows, step);
}

void Linearisation::renew(Group group, const Float4* pose, Scratch& scratch) {
  const auto rows = rows_[group];
  scratch.rows.assign(rows.size(), {});
  Summing summing(targets_[group], scratch.rows);
  NodeStep8 step{zero_vec8(), zero_sym_mat8()};
  tissue_.linearise(group, pose, load_group(pose + group * kLanes), step, summing);
  take(group, scratch.rows, step);
}

void Linearisation::take(Group group, std::span<const std::array<Lanes, 9>> sums,
                         const NodeStep8& step) {
  const auto rows = rows_[group];
  Float8 largest = all(0);
  for (const auto& row : sums)
    for (const Lanes& k : row) largest = _mm256_max_ps(largest, abs8(load(k)));
  Lanes lanes;
  store(lanes, largest);
  const float most = *std::ranges::max_element(lanes.v);
  const int exponent = most > 1e-30f ? exponent_of(most) - kLargestExponent : 0;
  const Float8 inverse = all(power_of_two(-exponent));
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (std::size_t k = 0; k < 9; ++k) to_halves(rows[i].k[k], load(sums[i][k]) * inverse);

  Node& node = nodes_[group];
  store(node.gradient, step.gradient);
  store(node.block, step.block);
  node.scale = power_of_two(exponent);
}

std::array<std::array<float, 3>, 3> Linearisation::stiffness(Slot slot, Slot other) const {
  std::array<std::array<float, 3>, 3> result{};
  const auto lane = slot % kLanes;
  for (const Row& row : rows_[slot / kLanes]) {
    if (row.neighbour.v[lane] != other || other == slot) continue;
    for (std::size_t i = 0; i < 9; ++i) {
      Lanes k;
      store(k, halves(row.k[i]) * all(nodes_[slot / kLanes].scale));
      result[i / 3][i % 3] = k.v[lane];
    }
  }
  return result;
}

}  // namespace trocar::dynamics
