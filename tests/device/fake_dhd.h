#pragma once

// Says what the fake of libdhd does, and what was done to it. It lies in the library; a test finds
// it by the library's function fake_dhd(). Where another program has loaded the library, it lies in
// the file that FAKE_DHD_FILE names, made by the test.

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace trocar::testing {

struct FakeDhd {
  // The test sets these.
  std::atomic<int> device_count{1}, type{104};
  std::atomic<int> position_result{0};  // 0: new, 1: as before, -1: error
  std::atomic<bool> may_open{true}, blocks{false};
  std::atomic<double> position[3]{};  // in the device's frame
  std::atomic<double> matrix_scale{1}, gripper_rad{0.45};
  std::atomic<int> buttons{0};

  // The library sets these.
  std::atomic<double> force[7]{};
  std::atomic<int> exchanges{0}, wrong_ids{0}, forces_while_closed{0};
  std::atomic<int> watchdog_ms{0}, stops{0}, closes{0};
  std::atomic<bool> is_open{false}, is_force_enabled{false};
  std::atomic<double> last_force_size{0};
  std::atomic<std::uint64_t> last_force_ns{0};  // monotonic clock
};

using FakeDhdAccess = FakeDhd* (*)();

}  // namespace trocar::testing
