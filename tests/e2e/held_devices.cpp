#include "tests/e2e/held_devices.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <new>
#include <nlohmann/json.hpp>
#include <thread>

#include "common/base/timing.h"

namespace trocar::e2e {

namespace fs = std::filesystem;

bool HeldDevice::press_until(double force_n, double seconds) {
  constexpr double kStep_m = 0.0002, kDeepest_m = 0.12;
  const auto end_ns = monotonic_ns() + static_cast<std::uint64_t>(seconds * 1e9);
  while (this->force_n() < force_n && monotonic_ns() < end_ns) {
    if (depth_m_ < kDeepest_m) set_depth(depth_m_ += kStep_m);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return this->force_n() >= force_n;
}

void HeldDevice::go_out() {
  for (; depth_m_ > 0; depth_m_ -= 0.001) {
    set_depth(depth_m_);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  set_depth(depth_m_ = 0);
}

HeldHaply::HeldHaply()
    : service_(
          [this] { return state(); },
          [this](int, const std::string& message) {
            const auto json = nlohmann::json::parse(message, nullptr, false);
            double square = 0;
            for (const auto& value : json["inverse3"][0]["commands"]["set_cursor_force"]["values"])
              square += std::pow(value.get<double>(), 2);
            note(std::sqrt(square));
            return std::optional(state());
          },
          [this] { note(0); }) {}

std::string HeldHaply::state() const {
  if (!is_plugged_) return R"({"session_id":7,"inverse3":[]})";
  // The service's y points away from the person, as depth does.
  const nlohmann::json cursor{{"x", 0}, {"y", -0.12 + depth_}, {"z", 0.15}};
  const nlohmann::json still{{"x", 0}, {"y", 0}, {"z", 0}};
  return nlohmann::json{{"session_id", 7},
                        {"inverse3",
                         {{{"device_id", "049D"},
                           {"state", {{"cursor_position", cursor}, {"cursor_velocity", still}}}}}}}
      .dump();
}

void HeldHaply::note(double force_n) {
  const std::lock_guard guard(lock_);
  felt_.push_back({monotonic_ns(), force_n});
}

double HeldHaply::force_n() const {
  const std::lock_guard guard(lock_);
  return felt_.empty() ? 0 : felt_.back().force_n;
}

std::size_t HeldHaply::message_count() const {
  const std::lock_guard guard(lock_);
  return felt_.size();
}

std::optional<double> HeldHaply::released_after_ms(std::uint64_t since_ns) const {
  const std::lock_guard guard(lock_);
  std::optional<double> released_ms = 0;
  for (const auto& felt : felt_) {
    if (felt.ns < since_ns) continue;
    if (felt.force_n > 0)
      released_ms.reset();
    else if (!released_ms)
      released_ms = static_cast<double>(felt.ns - since_ns) * 1e-6;
  }
  return released_ms;
}

HeldForceDimension::HeldForceDimension(const fs::path& folder) {
  const auto file = folder / "dhd.state";
  const int opened = open(file.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  EXPECT_EQ(ftruncate(opened, sizeof(testing::FakeDhd)), 0);
  void* const memory =
      mmap(nullptr, sizeof(testing::FakeDhd), PROT_READ | PROT_WRITE, MAP_SHARED, opened, 0);
  close(opened);
  fake_ = new (memory) testing::FakeDhd;
  fs::create_directories(folder / "library");
  fs::create_symlink(FAKE_DHD, folder / "library" / "libdhd.so.3");
  setenv("FAKE_DHD_FILE", file.c_str(), 1);
  setenv("LD_LIBRARY_PATH", (folder / "library").c_str(), 1);
}

HeldForceDimension::~HeldForceDimension() {
  unsetenv("FAKE_DHD_FILE");
  unsetenv("LD_LIBRARY_PATH");
  munmap(fake_, sizeof(testing::FakeDhd));
}

void HeldForceDimension::set_depth(double depth_m) {
  fake_->position[0] = -depth_m;  // its x points towards the person
}

double HeldForceDimension::force_n() const {
  const auto silent_ns = monotonic_ns() - std::min(monotonic_ns(), fake_->last_force_ns.load());
  const auto watchdog_ns = static_cast<std::uint64_t>(fake_->watchdog_ms) * 1'000'000;
  const bool lets_go = watchdog_ns > 0 && silent_ns > watchdog_ns;
  return lets_go ? 0 : fake_->last_force_size.load();
}

}  // namespace trocar::e2e
