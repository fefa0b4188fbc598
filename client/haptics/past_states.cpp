#include "client/haptics/past_states.h"

namespace trocar::haptics {
namespace {

template <typename Value>
Value between(const Value& a, const Value& b, double share) {
  return a + (b - a) * share;
}

}  // namespace

std::optional<std::size_t> PastStates::find(std::uint64_t time_us) const {
  std::size_t first = begin(), last = end();
  while (first < last) {
    const std::size_t middle = first + (last - first) / 2;
    if ((*this)[middle].time_us <= time_us)
      first = middle + 1;
    else
      last = middle;
  }
  if (first == begin()) return std::nullopt;
  return first - 1;
}

std::optional<PastState> PastStates::at(std::uint64_t time_us) const {
  const auto found = find(time_us);
  if (!found) return std::nullopt;
  PastState state = (*this)[*found];
  if (*found + 1 == end()) return state;
  const PastState& next = (*this)[*found + 1];
  const double share = static_cast<double>(time_us - state.time_us) /
                       static_cast<double>(next.time_us - state.time_us);
  state.time_us = time_us;
  state.tip_m = between(state.tip_m, next.tip_m, share);
  state.core_m = between(state.core_m, next.core_m, share);
  state.clearance_m = between(state.clearance_m, next.clearance_m, share);
  state.depth_m = between(state.depth_m, next.depth_m, share);
  state.grip_point_m = between(state.grip_point_m, next.grip_point_m, share);
  state.response.elastic_n = between(state.response.elastic_n, next.response.elastic_n, share);
  state.response.normal_n = between(state.response.normal_n, next.response.normal_n, share);
  state.response.rest_n = between(state.response.rest_n, next.response.rest_n, share);
  state.response.sides_n = between(state.response.sides_n, next.response.sides_n, share);
  state.response.stiffness_n_m =
      between(state.response.stiffness_n_m, next.response.stiffness_n_m, share);
  return state;
}

}  // namespace trocar::haptics
