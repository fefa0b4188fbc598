// A library with the names and signatures of libdhd, for tests of what uses it. FAKE_DHD_IS_OLD
// leaves a function out, as an older version would.

#include "tests/device/fake_dhd.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <thread>

namespace {

using trocar::testing::FakeDhd;

// Maps the test's file, in which a FakeDhd was made.
FakeDhd* shared_state(const char* name) {
  const int file = open(name, O_RDWR | O_CLOEXEC);
  if (file < 0) std::abort();
  void* const memory = mmap(nullptr, sizeof(FakeDhd), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  close(file);
  if (memory == MAP_FAILED) std::abort();
  return static_cast<FakeDhd*>(memory);
}

FakeDhd* state() {
  static FakeDhd own;
  static const char* const name = std::getenv("FAKE_DHD_FILE");
  static FakeDhd* const fake = name == nullptr ? &own : shared_state(name);
  return fake;
}

constexpr char kId = 3;  // not the index, so that a mix-up shows

bool is_ours(char id) {
  if (id != kId) ++state()->wrong_ids;
  return id == kId;
}

}  // namespace

extern "C" {

trocar::testing::FakeDhd* fake_dhd() {
  return state();
}
int dhdGetDeviceCount() {
  return state()->device_count;
}
int dhdOpenID(char index) {
  if (index != 0 || !state()->may_open) return -1;
  state()->is_open = true;
  return kId;
}
int dhdClose(char id) {
  if (!is_ours(id)) return -1;
  state()->is_open = false;
  ++state()->closes;
  return 0;
}
int dhdStop(char id) {
  if (!is_ours(id)) return -1;
  ++state()->stops;
  return 0;
}
int dhdGetSystemType(char id) {
  return is_ours(id) ? state()->type.load() : -1;
}
int dhdEnableForce(unsigned char value, char id) {
  if (!is_ours(id)) return -1;
  state()->is_force_enabled = value != 0;
  return 0;
}
#ifndef FAKE_DHD_IS_OLD
int dhdSetWatchdog(unsigned char milliseconds, char id) {
  if (!is_ours(id)) return -1;
  state()->watchdog_ms = milliseconds;
  return 0;
}
#endif
int dhdGetPosition(double* x, double* y, double* z, char id) {
  while (state()->blocks) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  if (!is_ours(id) || state()->position_result < 0) return -1;
  *x = state()->position[0], *y = state()->position[1], *z = state()->position[2];
  return state()->position_result;
}
int dhdGetLinearVelocity(double* x, double* y, double* z, char id) {
  if (!is_ours(id)) return -1;
  *x = 0.1, *y = 0.2, *z = 0.3;
  return 0;
}
int dhdGetOrientationFrame(double rows[3][3], char id) {
  if (!is_ours(id)) return -1;
  // A quarter of a turn about z, which points up.
  const double s = state()->matrix_scale;
  const double turned[3][3] = {{0, -s, 0}, {s, 0, 0}, {0, 0, s}};
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) rows[row][column] = turned[row][column];
  return 0;
}
int dhdGetGripperAngleRad(double* angle, char id) {
  if (!is_ours(id)) return -1;
  *angle = state()->gripper_rad;
  return 0;
}
int dhdGetButton(int index, char id) {
  return is_ours(id) ? (state()->buttons >> index) & 1 : -1;
}
int dhdSetForceAndTorqueAndGripperForce(double fx, double fy, double fz, double tx, double ty,
                                        double tz, double gripper, char id) {
  if (!is_ours(id)) return -1;
  auto& fake = *state();
  if (!fake.is_open) ++fake.forces_while_closed;
  const double values[] = {fx, fy, fz, tx, ty, tz, gripper};
  for (int i = 0; i < 7; ++i) fake.force[i] = values[i];
  fake.last_force_size = std::sqrt(fx * fx + fy * fy + fz * fz);
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  fake.last_force_ns =
      static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(now).count());
  ++fake.exchanges;
  return 0;
}
const char* dhdErrorGetLastStr() {
  return "fake \x1b[2J error";
}

}  // extern "C"
