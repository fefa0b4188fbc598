#pragma once

// Says what the fake of libHD does, and what was done to it. It lies in the library; a test finds
// it by the library's function fake_hd().

#include <atomic>

namespace trocar::testing {

struct FakeHd {
  // The test sets these.
  std::atomic<unsigned> init_error{0}, start_error{0}, frame_error{0};
  std::atomic<double> position_mm[3]{};
  std::atomic<double> matrix_scale{1}, max_force_n{3.3}, workspace_scale{1};
  std::atomic<int> buttons{0};
  std::atomic<bool> is_stuck{false};  // the scheduler calls nobody

  // The library sets these.
  std::atomic<double> force_n[3]{};
  std::atomic<double> last_force_size{0};
  std::atomic<int> frames{0}, calls_outside_frames{0}, errors_left{0};
  std::atomic<int> stops{0}, disables{0}, unschedules{0};
  std::atomic<bool> is_default_device{false}, is_force_enabled{false};
};

using FakeHdAccess = FakeHd* (*)();

}  // namespace trocar::testing
