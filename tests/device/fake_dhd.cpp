// A library with the names and signatures of libdhd, for tests of what uses it. FAKE_DHD_IS_OLD
// leaves a function out, as an older version would.

#include "tests/device/fake_dhd.h"

#include <chrono>
#include <cmath>
#include <thread>

namespace {

trocar::testing::FakeDhd* state() {
  static trocar::testing::FakeDhd fake;
  return &fake;
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
  ++fake.exchanges;
  return 0;
}
const char* dhdErrorGetLastStr() {
  return "fake \x1b[2J error";
}

}  // extern "C"
