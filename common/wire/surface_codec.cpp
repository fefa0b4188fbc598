#include "common/wire/surface_codec.h"

#include <algorithm>
#include <array>
#include <bit>
#include <optional>
#include <string>

#include "common/base/assert.h"
#include "common/base/varint.h"

namespace trocar::wire {
namespace {

constexpr std::size_t kBlockVertices = 64;
constexpr std::size_t kGroupVertices = 16;
constexpr int kModeCount = 3;
constexpr unsigned kModeBits = 2, kWidthBits = 5;
constexpr unsigned kGroupHeaderBits = kModeBits + 3 * kWidthBits;
// |value| <= 31250, |difference| <= 62500, |difference of differences| <= 125000: 18 bits zig-zag.
// Three of them and a partial byte fit one 64-bit load.
constexpr unsigned kMaxWidth = 18;
static_assert(3 * kMaxWidth + 7 <= 64);

enum Mode : unsigned { kTemporal = 0, kTemporalSpatial = 1, kAbsoluteSpatial = 2 };

bool in_range(const QuantisedVertex& v) {
  const auto outside = [](std::int32_t c) {
    return int{static_cast<std::uint32_t>(c + kMaxQuanta) > 2u * kMaxQuanta};
  };
  return (outside(v.x) | outside(v.y) | outside(v.z)) == 0;
}
std::size_t block_count_of(std::size_t vertices) {
  return (vertices + kBlockVertices - 1) / kBlockVertices;
}
// Bits of the slots that exist in a block; only the last one may have fewer than 64.
std::uint64_t full_mask(std::size_t block, std::size_t vertices) {
  const std::size_t slots = std::min(vertices - block * kBlockVertices, kBlockVertices);
  return slots == kBlockVertices ? ~std::uint64_t{0} : (std::uint64_t{1} << slots) - 1;
}

// The predictions of modes 1 and 2 start from this: the changed vertex before this one, zero at the
// start of a payload.
struct Predictor {
  QuantisedVertex value, difference;
};

// ---- writing ----

// Writes at most 57 bits at a time into memory that has 8 bytes to spare.
class BitWriter {
 public:
  explicit BitWriter(std::uint8_t* at) : at_(at) {}

  void put(std::uint64_t bits, unsigned count) {
    pending_ |= bits << pending_bits_;
    pending_bits_ += count;
    std::memcpy(at_, &pending_, sizeof pending_);
    at_ += pending_bits_ / 8;
    pending_ >>= pending_bits_ & ~7u;
    pending_bits_ &= 7;
  }
  // Pads to a whole byte; the first byte after what was written.
  std::uint8_t* finish() { return at_ + (pending_bits_ > 0); }

 private:
  std::uint8_t* at_;
  std::uint64_t pending_ = 0;
  unsigned pending_bits_ = 0;
};

using Residuals = std::array<std::array<std::uint32_t, 3>, kGroupVertices>;  // zig-zag, x y z

std::array<std::uint32_t, 3> residual(const QuantisedVertex& value, const QuantisedVertex& from) {
  return {zigzag(value.x - from.x), zigzag(value.y - from.y), zigzag(value.z - from.z)};
}

struct Packing {
  std::array<unsigned, 3> widths;
  unsigned bits() const { return widths[0] + widths[1] + widths[2]; }
};
Packing packing_of(const Residuals& residuals, std::size_t count) {
  std::array<std::uint32_t, 3> any{};
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t axis = 0; axis < 3; ++axis) any[axis] |= residuals[i][axis];
  const auto width = [](std::uint32_t v) { return static_cast<unsigned>(std::bit_width(v)); };
  return {{width(any[0]), width(any[1]), width(any[2])}};
}

void put_group(BitWriter& writer, unsigned mode, const Packing& packing, const Residuals& residuals,
               std::size_t count) {
  const auto [wx, wy, wz] = packing.widths;
  TROCAR_ASSERT(wx <= kMaxWidth && wy <= kMaxWidth && wz <= kMaxWidth);
  writer.put(
      mode | wx << kModeBits | wy << (kModeBits + kWidthBits) | wz << (kModeBits + 2 * kWidthBits),
      kGroupHeaderBits);
  for (std::size_t i = 0; i < count; ++i) {
    const auto& r = residuals[i];
    writer.put(r[0] | std::uint64_t{r[1]} << wx | std::uint64_t{r[2]} << (wx + wy), wx + wy + wz);
  }
}

// One group in the mode that takes the fewest bits; the lowest mode where they tie.
void encode_group(BitWriter& writer, const QuantisedVertex* baseline,
                  const QuantisedVertex* current, std::span<const std::uint8_t> slots,
                  Predictor& predictor) {
  std::array<Residuals, kModeCount> residuals;
  bool valid = true;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const QuantisedVertex& value = current[slots[i]];
    const QuantisedVertex& base = baseline[slots[i]];
    valid &= in_range(value);
    valid &= in_range(base);
    const QuantisedVertex difference = value - base;
    residuals[kTemporal][i] = residual(value, base);
    residuals[kTemporalSpatial][i] = residual(difference, predictor.difference);
    residuals[kAbsoluteSpatial][i] = residual(value, predictor.value);
    predictor = {value, difference};
  }
  TROCAR_ASSERT(valid);

  unsigned best = kTemporal;
  Packing best_packing = packing_of(residuals[kTemporal], slots.size());
  for (unsigned mode = kTemporalSpatial; mode < kModeCount; ++mode)
    if (const Packing packing = packing_of(residuals[mode], slots.size());
        packing.bits() < best_packing.bits()) {
      best = mode;
      best_packing = packing;
    }
  put_group(writer, best, best_packing, residuals[best], slots.size());
}

void encode_absolute_group(BitWriter& writer, std::span<const QuantisedVertex> group,
                           Predictor& predictor) {
  Residuals residuals;
  bool valid = true;
  for (std::size_t i = 0; i < group.size(); ++i) {
    valid &= in_range(group[i]);
    residuals[i] = residual(group[i], predictor.value);
    predictor.value = group[i];
  }
  TROCAR_ASSERT(valid);
  put_group(writer, kAbsoluteSpatial, packing_of(residuals, group.size()), residuals, group.size());
}

// Bytes that groups may take, and the 8 that BitWriter writes beyond.
std::size_t most_group_bytes(std::size_t groups, std::size_t vertices) {
  return (groups * kGroupHeaderBits + vertices * 3 * kMaxWidth + 7) / 8 + 8;
}

// Bit i: vertex i of the block differs.
std::uint64_t changed_mask(const QuantisedVertex* a, const QuantisedVertex* b,
                           std::size_t vertices) {
  if (std::memcmp(a, b, vertices * sizeof *a) == 0) return 0;
  std::uint64_t mask = 0;
  for (std::size_t i = 0; i < vertices; ++i) {
    const auto bits = (a[i].x ^ b[i].x) | (a[i].y ^ b[i].y) | (a[i].z ^ b[i].z);
    mask |= std::uint64_t{bits != 0} << i;
  }
  return mask;
}

// ---- reading ----

Error bad_payload(const char* what) {
  return {ErrorCode::BadMessage, std::string("surface payload: ") + what + "; ask for a keyframe"};
}

// Walks the list of changed blocks at the front of a payload.
class BlockList {
 public:
  BlockList(BytesView payload, std::size_t vertices) : reader_(payload), vertices_(vertices) {
    const auto count = read_varint(reader_, 0xffffffffu);
    ok_ = count && *count <= block_count_of(vertices);
    left_ = ok_ ? static_cast<std::uint32_t>(*count) : 0;
  }

  // Next block and its mask of changed slots; false at the end or when the list is malformed.
  bool next(std::size_t& block, std::uint64_t& mask) {
    if (left_ == 0) return false;
    --left_;
    const auto header = read_varint(reader_, 0xffffffffu);
    if (!header) return fail();
    const std::uint64_t at = next_block_ + (*header >> 1);
    if (at >= block_count_of(vertices_)) return fail();
    block = static_cast<std::size_t>(at);
    next_block_ = at + 1;
    const std::uint64_t full = full_mask(block, vertices_);
    // Two u32, low slots first, lie like one little-endian u64.
    mask = (*header & 1) ? full : reader_.read<std::uint64_t>();
    return (reader_.ok() && mask != 0 && (mask & ~full) == 0) || fail();
  }
  bool ok() const { return ok_; }
  std::size_t bytes_read() const { return reader_.position(); }

 private:
  bool fail() {
    left_ = 0;
    return ok_ = false;
  }

  ByteReader reader_;
  std::size_t vertices_;
  std::uint64_t next_block_ = 0;
  std::uint32_t left_ = 0;
  bool ok_ = false;
};

class BitReader {
 public:
  explicit BitReader(BytesView bytes) : bytes_(bytes) {}

  std::size_t bits_left() const { return bytes_.size() * 8 - position_; }
  // The next 57 bits or more, zeros past the end.
  std::uint64_t peek() const {
    const std::size_t byte = position_ / 8;
    std::uint64_t bits = 0;
    if (byte + sizeof bits <= bytes_.size()) [[likely]]
      std::memcpy(&bits, bytes_.data() + byte, sizeof bits);
    else if (byte < bytes_.size())
      std::memcpy(&bits, bytes_.data() + byte, bytes_.size() - byte);
    return bits >> (position_ & 7);
  }
  void skip(std::size_t count) { position_ += count; }

 private:
  BytesView bytes_;
  std::size_t position_ = 0;
};

// Decodes one group. kWrite false only checks: nothing that could fail is left to the second pass.
template <bool kWrite>
bool decode_group(BitReader& reader, QuantisedVertex* block, std::span<const std::uint8_t> slots,
                  bool absolute_only, Predictor& predictor) {
  if (reader.bits_left() < kGroupHeaderBits) return false;
  const std::uint64_t header = reader.peek();
  reader.skip(kGroupHeaderBits);
  const auto mode = static_cast<unsigned>(header & 3);
  const auto width = [header](unsigned axis) {
    return static_cast<unsigned>(header >> (kModeBits + axis * kWidthBits)) & 31;
  };
  const unsigned wx = width(0), wy = width(1), wz = width(2), bits = wx + wy + wz;
  if (mode >= kModeCount || (absolute_only && mode != kAbsoluteSpatial)) return false;
  if (wx > kMaxWidth || wy > kMaxWidth || wz > kMaxWidth) return false;
  if (reader.bits_left() < slots.size() * bits) return false;

  const auto mask = [](unsigned w) { return (std::uint64_t{1} << w) - 1; };
  const std::uint64_t mx = mask(wx), my = mask(wy), mz = mask(wz);
  bool valid = true;
  for (const std::uint8_t slot : slots) {
    const std::uint64_t packed = reader.peek();
    reader.skip(bits);
    const QuantisedVertex r{unzigzag(packed & mx), unzigzag(packed >> wx & my),
                            unzigzag(packed >> (wx + wy) & mz)};
    const QuantisedVertex base = block[slot];
    QuantisedVertex value;
    if (mode == kTemporal)
      value = base + r;
    else if (mode == kTemporalSpatial)
      value = base + predictor.difference + r;
    else
      value = predictor.value + r;
    valid &= in_range(value);
    if (!valid) return false;  // also keeps the sums of the next vertex from overflowing
    predictor = {value, value - base};
    if constexpr (kWrite) block[slot] = value;
  }
  return true;
}

template <bool kWrite>
bool decode_groups(BytesView payload, std::size_t bits_at, std::span<QuantisedVertex> surface,
                   bool absolute_only) {
  BlockList blocks(payload, surface.size());
  BitReader reader(payload.subspan(bits_at));
  Predictor predictor;
  std::size_t block = 0;
  for (std::uint64_t mask = 0; blocks.next(block, mask);) {
    while (mask != 0) {
      std::array<std::uint8_t, kGroupVertices> slots;
      std::size_t count = 0;
      for (; mask != 0 && count < kGroupVertices; mask &= mask - 1)
        slots[count++] = static_cast<std::uint8_t>(std::countr_zero(mask));
      if (!decode_group<kWrite>(reader, surface.data() + block * kBlockVertices,
                                std::span(slots).first(count), absolute_only, predictor))
        return false;
    }
  }
  return reader.bits_left() < 8 && reader.peek() == 0;  // padding only
}

// Two passes, first checking and then writing, so that an error leaves `surface` as it was without
// a copy or an allocation.
Status decode(BytesView payload, std::span<QuantisedVertex> surface, bool is_keyframe) {
  BlockList blocks(payload, surface.size());
  std::size_t block = 0, full_blocks = 0;
  for (std::uint64_t mask = 0; blocks.next(block, mask);)
    full_blocks += mask == full_mask(block, surface.size());
  if (!blocks.ok()) return bad_payload("list of changed blocks is malformed");
  if (is_keyframe && full_blocks != block_count_of(surface.size()))
    return bad_payload("keyframe does not hold every vertex");
  if (!decode_groups<false>(payload, blocks.bytes_read(), surface, is_keyframe))
    return bad_payload("group out of range, truncated or followed by more bytes");
  const bool written = decode_groups<true>(payload, blocks.bytes_read(), surface, is_keyframe);
  TROCAR_ASSERT(written);
  return {};
}

}  // namespace

EncodeReport encode_delta(std::span<const QuantisedVertex> baseline,
                          std::span<const QuantisedVertex> current, Bytes& out) {
  TROCAR_ASSERT(baseline.size() == current.size());
  struct ChangedBlock {
    std::size_t first_vertex;
    std::uint64_t mask;
  };
  std::vector<ChangedBlock> changed;
  changed.reserve(block_count_of(current.size()));
  EncodeReport report;
  std::size_t group_count = 0;
  for (std::size_t first = 0; first < current.size(); first += kBlockVertices) {
    const std::size_t slots = std::min(current.size() - first, kBlockVertices);
    const std::uint64_t mask = changed_mask(&baseline[first], &current[first], slots);
    if (mask == 0) continue;
    changed.push_back({first, mask});
    const auto count = static_cast<std::size_t>(std::popcount(mask));
    report.changed_vertices += count;
    group_count += (count + kGroupVertices - 1) / kGroupVertices;
  }

  put_varint(out, static_cast<std::uint32_t>(changed.size()));
  std::size_t next_block = 0;
  for (const ChangedBlock& c : changed) {
    const std::size_t block = c.first_vertex / kBlockVertices;
    const bool is_full = c.mask == full_mask(block, current.size());
    put_varint(out, static_cast<std::uint32_t>((block - next_block) << 1 | is_full));
    if (!is_full) ByteWriter(out).put(c.mask);
    next_block = block + 1;
  }

  const std::size_t bits_at = out.size();
  out.resize(bits_at + most_group_bytes(group_count, report.changed_vertices));
  BitWriter writer(out.data() + bits_at);
  Predictor predictor;
  for (const ChangedBlock& c : changed) {
    for (std::uint64_t mask = c.mask; mask != 0;) {
      std::array<std::uint8_t, kGroupVertices> slots;
      std::size_t count = 0;
      for (; mask != 0 && count < kGroupVertices; mask &= mask - 1)
        slots[count++] = static_cast<std::uint8_t>(std::countr_zero(mask));
      encode_group(writer, &baseline[c.first_vertex], &current[c.first_vertex],
                   std::span(slots).first(count), predictor);
    }
  }
  out.resize(static_cast<std::size_t>(writer.finish() - out.data()));
  return report;
}

void encode_keyframe(std::span<const QuantisedVertex> current, Bytes& out) {
  const std::size_t block_count = block_count_of(current.size());
  put_varint(out, static_cast<std::uint32_t>(block_count));
  for (std::size_t block = 0; block < block_count; ++block) put_varint(out, 1);  // gap 0, full
  const std::size_t bits_at = out.size();
  // 64 is a multiple of 16, so no group crosses a block.
  const std::size_t group_count = (current.size() + kGroupVertices - 1) / kGroupVertices;
  out.resize(bits_at + most_group_bytes(group_count, current.size()));
  BitWriter writer(out.data() + bits_at);
  Predictor predictor;
  for (std::size_t first = 0; first < current.size(); first += kGroupVertices)
    encode_absolute_group(writer,
                          current.subspan(first, std::min(kGroupVertices, current.size() - first)),
                          predictor);
  out.resize(static_cast<std::size_t>(writer.finish() - out.data()));
}

Status decode_delta(BytesView payload, std::span<QuantisedVertex> surface) {
  return decode(payload, surface, false);
}
Status decode_keyframe(BytesView payload, std::span<QuantisedVertex> surface) {
  return decode(payload, surface, true);
}

}  // namespace trocar::wire
