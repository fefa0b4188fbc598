// A library with the names and signatures of libHD, for tests of what uses it. FAKE_HD_IS_OLD
// leaves a function out, as an older version would.

#include "tests/device/fake_hd.h"

#include <chrono>
#include <cmath>
#include <thread>

namespace {

using Callback = unsigned (*)(void*);

struct Error {
  unsigned code;
  int internal;
  unsigned device;
};

trocar::testing::FakeHd* state() {
  static trocar::testing::FakeHd fake;
  return &fake;
}

constexpr unsigned kDevice = 5;

std::thread scheduler;
std::atomic<bool> is_running{false};
Callback callback = nullptr;
void* user_data = nullptr;
thread_local bool is_in_frame = false;

// The queue of errors of one thread.
thread_local unsigned pending_error = 0;

void run() {
  while (is_running) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    if (state()->is_stuck || callback == nullptr) continue;
    if (callback(user_data) == 0) callback = nullptr;
    ++state()->frames;
  }
}

void note_frame() {
  if (!is_in_frame) ++state()->calls_outside_frames;
}

}  // namespace

extern "C" {

trocar::testing::FakeHd* fake_hd() {
  return state();
}
unsigned hdInitDevice(const char* name) {
  state()->is_default_device = name == nullptr;
  pending_error = state()->init_error;
  return pending_error == 0 ? kDevice : 0xffffffff;
}
void hdDisableDevice(unsigned) {
  ++state()->disables;
}
void hdMakeCurrentDevice(unsigned) {}
void hdEnable(unsigned capability) {
  if (capability == 0x4000) state()->is_force_enabled = true;
}
unsigned long hdScheduleAsynchronous(Callback function, void* data, unsigned short) {
  callback = function;
  user_data = data;
  return 77;
}
void hdUnschedule(unsigned long task) {
  if (task == 77) ++state()->unschedules;
  callback = nullptr;
}
void hdStartScheduler() {
  pending_error = state()->start_error;
  if (pending_error != 0) return;
  is_running = true;
  scheduler = std::thread(run);
}
void hdStopScheduler() {
  is_running = false;
  if (scheduler.joinable()) scheduler.join();
  ++state()->stops;
}
void hdBeginFrame(unsigned) {
  is_in_frame = true;
}
void hdEndFrame(unsigned) {
  is_in_frame = false;
  pending_error = state()->frame_error;
}
void hdGetDoublev(unsigned parameter, double* values) {
  auto& fake = *state();
  const double half_mm[] = {80, 60, 35};
  switch (parameter) {
    case 0x2050:
      note_frame();
      for (int i = 0; i < 3; ++i) values[i] = fake.position_mm[i];
      break;
    case 0x2051:
      note_frame();
      values[0] = 100, values[1] = 200, values[2] = 300;
      break;
    case 0x2052: {
      note_frame();
      // A quarter of a turn about y, by columns.
      const double s = fake.matrix_scale;
      const double turned[16] = {0, 0, -s, 0, 0, s, 0, 0, s, 0, 0, 0, 0, 0, 0, 1};
      for (int i = 0; i < 16; ++i) values[i] = turned[i];
      break;
    }
    case 0x2551:
      for (int i = 0; i < 3; ++i) {
        values[i] = (10 - half_mm[i]) * fake.workspace_scale;
        values[i + 3] = (10 + half_mm[i]) * fake.workspace_scale;
      }
      break;
    case 0x2602:
      values[0] = 0.5;
      break;
    case 0x2603:
      values[0] = fake.max_force_n;
      break;
    default:
      pending_error = 0x0100;
  }
}
void hdGetIntegerv(unsigned parameter, int* values) {
  if (parameter == 0x2000) values[0] = state()->buttons;
}
void hdSetDoublev(unsigned parameter, const double* values) {
  note_frame();
  if (parameter != 0x2700) return;
  for (int i = 0; i < 3; ++i) state()->force_n[i] = values[i];
  state()->last_force_size = std::hypot(values[0], values[1], values[2]);
}
const char* hdGetString(unsigned) {
  return "Touch";
}
Error hdGetError() {
  const Error error{pending_error, 0, kDevice};
  pending_error = 0;
  return error;
}
#ifndef FAKE_HD_IS_OLD
const char* hdGetErrorString(unsigned) {
  return "fake \x1b[2J error";
}
#endif

}  // extern "C"
