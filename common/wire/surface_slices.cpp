#include "common/wire/surface_slices.h"

#include <algorithm>

#include "common/base/assert.h"
#include "common/wire/surface_codec.h"

namespace trocar::wire {
namespace {

constexpr std::size_t kSliceBlock = 64;
// A mask, a gap and 64 vertices of three 18-bit differences, in groups with headers; and with 64
// levels.
constexpr std::size_t kMostBlockBytes = 500, kMostBloodBlockBytes = 100;

class Slicer {
 public:
  Slicer(std::span<const QuantisedVertex> baseline, std::span<const QuantisedVertex> current,
         std::size_t most_bytes, const SlicedBlood& blood)
      : baseline_(baseline), current_(current), blood_(blood), most_bytes_(most_bytes) {}

  // Encodes [first, last), and halves it until the parts fit.
  void add(std::size_t first, std::size_t last) {
    if (slices.size() > kMaxSlices) return;
    SurfaceSlice slice{
        static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(last - first), {}, {}};
    encode_delta(baseline_.subspan(first, last - first), current_.subspan(first, last - first),
                 slice.payload);
    if (!blood_.current.empty()) {
      const auto before = blood_.baseline.subspan(std::min(first, blood_.baseline.size()));
      encode_blood(before.first(std::min(last - first, before.size())),
                   blood_.current.subspan(first, last - first), slice.blood);
    }
    if (slice.payload.size() + slice.blood.size() <= most_bytes_) {
      slices.push_back(std::move(slice));
      return;
    }
    const std::size_t blocks = (last - first + kSliceBlock - 1) / kSliceBlock;
    TROCAR_ASSERT(blocks > 1);
    const std::size_t middle = first + blocks / 2 * kSliceBlock;
    add(first, middle);
    add(middle, last);
  }

  std::vector<SurfaceSlice> slices;

 private:
  std::span<const QuantisedVertex> baseline_, current_;
  const SlicedBlood& blood_;
  std::size_t most_bytes_;
};

}  // namespace

std::vector<SurfaceSlice> encode_slices(std::span<const QuantisedVertex> baseline,
                                        std::span<const QuantisedVertex> current,
                                        std::size_t most_bytes, const SlicedBlood& blood) {
  TROCAR_ASSERT(baseline.size() == current.size());
  TROCAR_ASSERT(most_bytes >= kMostBlockBytes + (blood.current.empty() ? 0 : kMostBloodBlockBytes));
  TROCAR_ASSERT(blood.current.empty() || blood.current.size() == current.size());
  Slicer slicer(baseline, current, most_bytes, blood);
  slicer.add(0, current.size());
  auto& slices = slicer.slices;
  // Halves without a change say nothing, unless nothing has changed at all.
  const auto is_empty = [](const SurfaceSlice& slice) {
    return slice.payload.size() <= 1 && slice.blood.empty();
  };
  const bool has_change = !std::ranges::all_of(slices, is_empty);
  if (has_change) std::erase_if(slices, is_empty);
  if (slices.size() > kMaxSlices) slices.clear();
  return std::move(slices);
}

Status decode_slice(const SurfaceSlice& slice, std::span<QuantisedVertex> surface,
                    std::span<std::uint8_t> levels) {
  const std::size_t first = slice.first_vertex, count = slice.vertices;
  const bool is_inside = first <= surface.size() && count <= surface.size() - first;
  const bool is_whole =
      first % kSliceBlock == 0 && (count % kSliceBlock == 0 || first + count == surface.size());
  if (!is_inside || !is_whole)
    return Error{ErrorCode::BadMessage, "SurfaceSlice: vertices " + std::to_string(first) + " to " +
                                            std::to_string(first + count) +
                                            " are not blocks of a surface of " +
                                            std::to_string(surface.size())};
  if (levels.size() != surface.size())
    return decode_delta(slice.payload, surface.subspan(first, count));
  // Both or neither: levels are looked at first, and a copy of them is what may be thrown away.
  BloodLevels bled(levels.begin() + static_cast<std::ptrdiff_t>(first),
                   levels.begin() + static_cast<std::ptrdiff_t>(first + count));
  if (const auto read = decode_blood(slice.blood, bled); !read) return read;
  if (const auto read = decode_delta(slice.payload, surface.subspan(first, count)); !read)
    return read;
  std::ranges::copy(bled, levels.begin() + static_cast<std::ptrdiff_t>(first));
  return {};
}

}  // namespace trocar::wire
