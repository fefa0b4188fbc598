#include "common/wire/blood_codec.h"

#include <algorithm>
#include <bit>
#include <string>

#include "common/base/assert.h"
#include "common/base/checksum.h"
#include "common/base/varint.h"

namespace trocar::wire {
namespace {

constexpr std::size_t kBlock = 64;

Error bad(const std::string& what) {
  return {ErrorCode::BadMessage, "blood: " + what};
}

// Calls visit(first slot, mask, levels of the mask's bits); stops at the first error.
template <typename Visit>
Status each_block(BytesView payload, std::size_t vertices, const Visit& visit) {
  const std::size_t blocks = (vertices + kBlock - 1) / kBlock;
  ByteReader reader(payload);
  for (std::size_t next = 0; reader.remaining() > 0; ++next) {
    const auto gap = read_varint(reader, blocks);
    if (!gap || next + *gap >= blocks)
      return bad("a block lies beyond the " + std::to_string(vertices) + " vertices");
    next += static_cast<std::size_t>(*gap);
    const std::size_t first = next * kBlock, count = std::min(kBlock, vertices - first);
    const auto mask = reader.read<std::uint64_t>();
    const bool is_inside = count == kBlock || mask >> count == 0;
    if (!reader.ok() || mask == 0 || !is_inside)
      return bad("the mask of block " + std::to_string(next) +
                 " is cut short, empty, or has vertices beyond the surface");
    const auto levels = reader.read_bytes(static_cast<std::uint64_t>(std::popcount(mask)));
    if (!reader.ok()) return bad("the levels of block " + std::to_string(next) + " are cut short");
    visit(first, mask, levels);
  }
  return {};
}

}  // namespace

void encode_blood(std::span<const std::uint8_t> baseline, std::span<const std::uint8_t> current,
                  Bytes& out) {
  TROCAR_ASSERT(baseline.size() <= current.size());
  ByteWriter writer(out);
  std::size_t next = 0;
  for (std::size_t first = 0; first < current.size(); first += kBlock) {
    const std::size_t end = std::min(first + kBlock, current.size());
    std::uint64_t mask = 0;
    for (std::size_t i = first; i < end; ++i) {
      const std::uint8_t before = i < baseline.size() ? baseline[i] : std::uint8_t{0};
      if (current[i] != before) mask |= std::uint64_t{1} << (i - first);
    }
    if (mask == 0) continue;
    put_varint(out, first / kBlock - next);
    next = first / kBlock + 1;
    writer.put(mask);
    for (std::size_t i = first; i < end; ++i)
      if ((mask >> (i - first) & 1) != 0) out.push_back(current[i]);
  }
}

Status decode_blood(BytesView payload, std::span<std::uint8_t> levels) {
  const Status checked = each_block(payload, levels.size(), [](auto, auto, auto) {});
  if (!checked) return checked;
  return each_block(payload, levels.size(),
                    [&](std::size_t first, std::uint64_t mask, BytesView bytes) {
                      std::size_t taken = 0;
                      for (std::size_t bit = 0; bit < kBlock; ++bit)
                        if ((mask >> bit & 1) != 0) levels[first + bit] = bytes[taken++];
                    });
}

std::uint32_t blood_crc(std::span<const std::uint8_t> levels) {
  return crc32(levels);
}

}  // namespace trocar::wire
