#pragma once

// Fakes of devices that speak the real interfaces, for a client in another process, and what their
// hands feel over time.

#include <atomic>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "tests/device/fake_dhd.h"
#include "tests/device/fake_haply.h"

namespace trocar::e2e {

// A hand that goes where it is told and is not moved by what it feels.
class HeldDevice {
 public:
  virtual ~HeldDevice() = default;
  virtual std::string name() const = 0;  // for --device
  // Towards the tissue from where it began, m.
  virtual void set_depth(double depth_m) = 0;
  // Rendered now, N. A device whose program is gone renders none once its watchdog has acted.
  virtual double force_n() const = 0;

  // Goes in at 20 mm/s until it feels so much, at most 120 mm; then it stays there. False: it felt
  // less.
  bool press_until(double force_n, double seconds = 60);
  void go_out();

 protected:
  double depth_m_ = 0;
};

// The Inverse Service with one Inverse3. When a connection ends it renders no force, as with the
// service's own device: nobody commands it any more.
class HeldHaply final : public HeldDevice {
 public:
  HeldHaply();
  std::string name() const override { return "haply:" + service_.url(); }
  void set_depth(double depth_m) override { depth_ = depth_m; }
  double force_n() const override;

  void unplug() { is_plugged_ = false; }
  void plug_in() { is_plugged_ = true; }
  bool was_closed() const { return service_.was_closed(); }
  std::size_t message_count() const;
  // Milliseconds from `since_ns` (monotonic clock) until the last force that was not zero ended;
  // none: a force is still rendered. 0: none was after that.
  std::optional<double> released_after_ms(std::uint64_t since_ns) const;

 private:
  struct Felt {
    std::uint64_t ns;
    double force_n;
  };
  std::string state() const;
  void note(double force_n);

  std::atomic<double> depth_{0};
  std::atomic<bool> is_plugged_{true};
  mutable std::mutex lock_;
  std::vector<Felt> felt_;
  trocar::testing::FakeHaply service_;
};

// The maker's library for a Force Dimension device, loaded by the client: the memory is shared.
// Only one of them at a time.
class HeldForceDimension final : public HeldDevice {
 public:
  explicit HeldForceDimension(const std::filesystem::path& folder);
  ~HeldForceDimension() override;
  std::string name() const override { return "forcedimension"; }
  void set_depth(double depth_m) override;
  // A device that nobody writes to lets go by its watchdog.
  double force_n() const override;
  testing::FakeDhd& fake() { return *fake_; }

 private:
  testing::FakeDhd* fake_ = nullptr;
};

}  // namespace trocar::e2e
