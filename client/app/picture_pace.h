#pragma once

// Says when the next picture is due. Drawing in software takes the processors that a server on the
// same machine needs for the tissue. So it rests after each picture for as long as that took, but
// not below 20 pictures a second, as far as drawing is quick enough for them. Where it is not,
// fewer pixels are drawn.

#include <algorithm>
#include <array>
#include <cstddef>
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
  // Says which share of the pixels along a side is to be drawn. It goes down where most pictures of
  // a while were slow, and never up again: who sees the picture change sees nothing else.
  float fineness() const { return kFineness[level_]; }
  void note_picture(std::uint64_t begin_ns, std::uint64_t end_ns) {
    next_ns_ = std::max(next_ns_ + interval_ns_, begin_ns);
    if (!yields_) return;
    const std::uint64_t took_ns = end_ns - begin_ns;
    judge(took_ns);
    next_ns_ = std::max(next_ns_,
                        std::min(end_ns + took_ns, std::max(begin_ns + kLongestYieldNs, end_ns)));
  }

 private:
  static constexpr std::array<float, 3> kFineness{1.0f, 0.7f, 0.5f};
  static constexpr std::uint64_t kSlowNs = 110'000'000;
  static constexpr int kJudged = 24;  // pictures

  void judge(std::uint64_t took_ns) {
    slow_ += took_ns > kSlowNs ? 1 : 0;
    if (++judged_ < kJudged) return;
    if (2 * slow_ > kJudged) level_ = std::min(level_ + 1, kFineness.size() - 1);
    judged_ = slow_ = 0;
  }

  std::size_t level_ = 0;
  int judged_ = 0, slow_ = 0;  // pictures
  std::uint64_t interval_ns_, next_ns_ = 0;
  bool yields_ = false;
};

}  // namespace trocar::app
