#pragma once

// A trace keeps what a hand did and felt, one row a step, in memory that was set aside before. Read
// it when the loop has stopped.

#include <cstdint>
#include <span>
#include <vector>

#include "common/math/vec3.h"

namespace trocar::haptics {

struct TraceRow {
  std::uint64_t time_us = 0;
  Vec3f tip_m;               // world frame
  Vec3f force_n;             // as it was written, in the device's frame
  Vec3f server_force_n;      // of the newest answer, world frame
  float patch_age_s = 0;     // since that came
  std::uint32_t limits = 0;  // as in SafeForce
};

class Trace {
 public:
  explicit Trace(std::size_t most_rows) : rows_(most_rows) {}

  // Rows beyond the most are left out.
  void add(const TraceRow& row) {
    if (count_ < rows_.size()) rows_[count_++] = row;
  }
  bool is_full() const { return count_ == rows_.size(); }
  std::span<const TraceRow> rows() const { return std::span(rows_).first(count_); }

 private:
  std::vector<TraceRow> rows_;
  std::size_t count_ = 0;
};

}  // namespace trocar::haptics
