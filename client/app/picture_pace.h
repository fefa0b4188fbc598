#pragma once

// Says when the next picture is due. Drawing in software takes the processors that a server on the
// same machine needs for the tissue. So it rests after each picture for as long as that took, but
// not below 20 pictures a second, as far as drawing is quick enough for them.

#include <algorithm>
#include <cstdint>

namespace trocar::app {

class PicturePace {
 public:
  static constexpr std::uint64_t kLongestYieldNs = 50'000'000;  // from picture to picture

  explicit PicturePace(double pictures_per_second)
      : interval_ns_(static_cast<std::uint64_t>(1e9 / pictures_per_second)) {}

  void yield() { yields_ = true; }
  bool is_due(std::uint64_t now_ns) const { return now_ns >= next_ns_; }
  std::uint64_t next_ns() const { return next_ns_; }
  void note_picture(std::uint64_t begin_ns, std::uint64_t end_ns) {
    next_ns_ = std::max(next_ns_ + interval_ns_, begin_ns);
    if (!yields_) return;
    const std::uint64_t took_ns = end_ns - begin_ns;
    next_ns_ = std::max(next_ns_,
                        std::min(end_ns + took_ns, std::max(begin_ns + kLongestYieldNs, end_ns)));
  }

 private:
  std::uint64_t interval_ns_, next_ns_ = 0;
  bool yields_ = false;
};

}  // namespace trocar::app
