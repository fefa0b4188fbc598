#pragma once

// Numbers of a message, big-endian, as OpenIGTLink has them. Never reads past the end: the first
// failed read makes ok() false, and every later one returns zero.

#include <algorithm>
#include <array>
#include <bit>

#include "client/slicer/incoming.h"
#include "common/base/bytes.h"

namespace trocar::slicer {

inline constexpr std::size_t kImageHeaderBytes = 72, kSurfaceHeaderBytes = 40;
// Points, and cells with a count before each.
inline constexpr std::size_t kMostSurfaceBytes =
    12 * kMostSurfacePoints + 16 * kMostSurfaceTriangles + (std::size_t{16} << 20);

class BigEndian {
 public:
  explicit BigEndian(BytesView bytes) : bytes_(bytes) {}

  bool ok() const { return is_ok_; }
  std::size_t remaining() const { return bytes_.size(); }
  BytesView rest() const { return bytes_; }

  template <PlainNumber T>
  T read() {
    std::array<std::uint8_t, sizeof(T)> own{};
    const auto from = take(sizeof(T));
    std::reverse_copy(from.begin(), from.end(), own.begin());
    return std::bit_cast<T>(own);
  }
  // Empty if there are not so many.
  BytesView take(std::uint64_t count) {
    if (!is_ok_ || count > bytes_.size()) {
      is_ok_ = false;
      return {};
    }
    const auto taken = bytes_.first(static_cast<std::size_t>(count));
    bytes_ = bytes_.subspan(taken.size());
    return taken;
  }
  void skip(std::uint64_t count) { take(count); }

 private:
  BytesView bytes_;
  bool is_ok_ = true;
};

// The message is not as it may be.
Error wrong(const Header& header, const std::string& what);

}  // namespace trocar::slicer
