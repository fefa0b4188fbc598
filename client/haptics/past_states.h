#pragma once

// The last states of a local model by the client's clock, so that the server's answer is compared
// with what the model said at the pose that the answer belongs to.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "client/haptics/push_element.h"
#include "common/math/vec3.h"

namespace trocar::haptics {

struct PastState {
  std::uint64_t time_us = 0;
  Vec3d tip_m, core_m;     // core: the centre of the round tip
  Vec3d axis;              // back along the shaft
  double clearance_m = 0;  // from the core's centre to the tool's surface, towards the tissue
  double depth_m = 0;      // under the surface as it was believed then
  Vec3d grip_point_m;
  Response response;
};

class PastStates {
 public:
  static constexpr std::size_t kCapacity = 4096;

  PastStates() : states_(kCapacity) {}

  // Times grow.
  void add(const PastState& state) { states_[count_++ % kCapacity] = state; }

  bool is_empty() const { return count_ == 0; }
  std::size_t begin() const { return count_ > kCapacity ? count_ - kCapacity : 0; }
  std::size_t end() const { return count_; }
  PastState& operator[](std::size_t i) { return states_[i % kCapacity]; }
  const PastState& operator[](std::size_t i) const { return states_[i % kCapacity]; }

  // The last state that is not younger; nothing if all are.
  std::optional<std::size_t> find(std::uint64_t time_us) const;
  // Between the states around that time; the newest for a later time. Nothing if all are younger.
  std::optional<PastState> at(std::uint64_t time_us) const;

 private:
  std::vector<PastState> states_;
  std::size_t count_ = 0;  // ever added
};

}  // namespace trocar::haptics
