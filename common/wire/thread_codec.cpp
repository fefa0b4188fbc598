#include "common/wire/thread_codec.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <span>
#include <string>

#include "common/base/assert.h"
#include "common/base/varint.h"

namespace trocar::wire {
namespace {

constexpr std::size_t kNodesPerBlock = 16, kAxes = 3;
constexpr unsigned kParameterBits = 4, kMostQuotient = 16, kPlainBits = 24;
constexpr unsigned kParameters = 1u << kParameterBits;

Error bad_threads(const std::string& what) {
  return {ErrorCode::BadMessage, "threads: " + what};
}

// Low bits first.
class RiceWriter {
 public:
  explicit RiceWriter(Bytes& out) : out_(out) {}
  ~RiceWriter() {
    if (count_ > 0) out_.push_back(static_cast<std::uint8_t>(bits_));
  }
  RiceWriter(const RiceWriter&) = delete;
  RiceWriter& operator=(const RiceWriter&) = delete;

  void put(std::uint32_t value, unsigned bits) {
    bits_ |= std::uint64_t{value} << count_;
    for (count_ += bits; count_ >= 8; count_ -= 8, bits_ >>= 8)
      out_.push_back(static_cast<std::uint8_t>(bits_));
  }

 private:
  Bytes& out_;
  std::uint64_t bits_ = 0;
  unsigned count_ = 0;
};

// Zeros beyond the end, and then ok() is false.
class RiceReader {
 public:
  explicit RiceReader(BytesView bytes) : bytes_(bytes) {}

  std::uint32_t get(unsigned bits) {
    while (count_ < bits) {
      is_ok_ &= at_ < bytes_.size();
      const std::uint64_t next = is_ok_ ? bytes_[at_++] : 0;
      bits_ |= next << count_;
      count_ += 8;
    }
    const auto value = static_cast<std::uint32_t>(bits_ & ((std::uint64_t{1} << bits) - 1));
    bits_ >>= bits;
    count_ -= bits;
    return value;
  }
  bool ok() const { return is_ok_; }
  // All bytes are read, and what is left of the last one is zero.
  bool is_at_end() const { return is_ok_ && at_ == bytes_.size() && bits_ == 0; }

 private:
  BytesView bytes_;
  std::size_t at_ = 0;
  std::uint64_t bits_ = 0;
  unsigned count_ = 0;
  bool is_ok_ = true;
};

unsigned rice_bits(std::uint32_t value, unsigned parameter) {
  const auto quotient = value >> parameter;
  return quotient < kMostQuotient ? quotient + 1 + parameter : kMostQuotient + kPlainBits;
}

void put_rice(std::uint32_t value, unsigned parameter, RiceWriter& out) {
  const auto quotient = value >> parameter;
  if (quotient >= kMostQuotient) {
    out.put((1u << kMostQuotient) - 1, kMostQuotient);
    return out.put(value, kPlainBits);
  }
  out.put((1u << quotient) - 1, quotient + 1);
  out.put(value & ((1u << parameter) - 1), parameter);
}

std::uint32_t get_rice(unsigned parameter, RiceReader& in) {
  std::uint32_t quotient = 0;
  while (quotient < kMostQuotient && in.get(1) == 1) ++quotient;
  if (quotient == kMostQuotient) return in.get(kPlainBits);
  return quotient << parameter | in.get(parameter);
}

// Returns where the nodes before it point.
QuantisedVertex expected(std::span<const QuantisedVertex> places, std::size_t node) {
  if (node == 0) return {};
  const auto& last = places[node - 1];
  if (node == 1) return last;
  const auto& before = places[node - 2];
  return {2 * last.x - before.x, 2 * last.y - before.y, 2 * last.z - before.z};
}

void put_places(std::span<const QuantisedVertex> places, Bytes& out) {
  RiceWriter writer(out);
  std::array<std::uint32_t, kNodesPerBlock * kAxes> values;
  for (std::size_t first = 0; first < places.size(); first += kNodesPerBlock) {
    const std::size_t end = std::min(first + kNodesPerBlock, places.size());
    std::size_t count = 0;
    for (std::size_t i = first; i < end; ++i) {
      const auto from = expected(places, i);
      for (const auto difference :
           {places[i].x - from.x, places[i].y - from.y, places[i].z - from.z})
        values[count++] = zigzag(difference);
    }
    unsigned best = 0, least = ~0u;
    for (unsigned parameter = 0; parameter < kParameters; ++parameter) {
      unsigned bits = 0;
      for (std::size_t k = 0; k < count; ++k) bits += rice_bits(values[k], parameter);
      if (bits < least) least = bits, best = parameter;
    }
    writer.put(best, kParameterBits);
    for (std::size_t k = 0; k < count; ++k) put_rice(values[k], best, writer);
  }
}

Status get_places(BytesView bytes, std::span<QuantisedVertex> places) {
  RiceReader reader(bytes);
  unsigned parameter = 0;
  const auto is_near = [](std::int32_t v) { return std::abs(v) <= kMostThreadQuanta; };
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (i % kNodesPerBlock == 0) parameter = reader.get(kParameterBits);
    auto place = expected(places, i);
    place.x += unzigzag(get_rice(parameter, reader));
    place.y += unzigzag(get_rice(parameter, reader));
    place.z += unzigzag(get_rice(parameter, reader));
    if (!reader.ok()) return bad_threads("the places are cut short at node " + std::to_string(i));
    if (!is_near(place.x) || !is_near(place.y) || !is_near(place.z))
      return bad_threads("node " + std::to_string(i) + " is more than 4.2 m away");
    places[i] = place;
  }
  if (!reader.is_at_end()) return bad_threads("there are bytes after the last place");
  return {};
}

Status get_threads(ByteReader& reader, ThreadPicture& picture) {
  const auto threads = read_varint(reader, kMostThreads);
  if (!threads || *threads == 0) return bad_threads("there are not 1 to 8");
  std::size_t all = 0;
  for (std::uint64_t i = 0; i < *threads; ++i) {
    const auto nodes = read_varint(reader, kMostThreadNodes);
    const auto material = reader.read<std::uint8_t>();
    if (!nodes || *nodes < kLeastThreadNodes || (all += *nodes) > kMostThreadNodes)
      return bad_threads("the nodes of thread " + std::to_string(i) + " are not 4 to 1200 in all");
    if (!reader.ok() || material >= kThreadMaterials)
      return bad_threads("the material of thread " + std::to_string(i) + " is not 0 to 3");
    picture.threads.push_back({static_cast<std::uint32_t>(*nodes), material});
    picture.is_joined.resize(all, 1);
    picture.is_joined.back() = 0;
  }
  picture.places.resize(all);
  return {};
}

Status get_pegs(ByteReader& reader, ThreadPicture& picture) {
  const auto pegs = read_varint(reader, kMostThreadPegs);
  if (!pegs) return bad_threads("there are more than 32 pegs");
  constexpr std::uint64_t kMost = 2 * std::uint64_t{kMostThreadQuanta};
  for (std::uint64_t i = 0; i < *pegs; ++i) {
    ThreadPeg peg;
    for (auto* value :
         {&peg.from.x, &peg.from.y, &peg.from.z, &peg.to.x, &peg.to.y, &peg.to.z, &peg.radius}) {
      const auto read = read_varint(reader, kMost);
      if (!read)
        return bad_threads("peg " + std::to_string(i) + " is cut short, or more than 4.2 m away");
      *value = unzigzag(*read);
    }
    if (peg.radius < 1)
      return bad_threads("the radius of peg " + std::to_string(i) + " is less than 32 um");
    picture.pegs.push_back(peg);
  }
  return {};
}

Status get_parted(ByteReader& reader, ThreadPicture& picture) {
  const auto parted = read_varint(reader, picture.places.size());
  if (!parted) return bad_threads("more segments are parted than there are");
  std::uint64_t node = 0;
  for (std::uint64_t i = 0; i < *parted; ++i) {
    const auto step = read_varint(reader, picture.places.size());
    if (!step || node + *step >= picture.places.size())
      return bad_threads("a parted segment is beyond the last node");
    node += *step;
    picture.is_joined[static_cast<std::size_t>(node)] = 0;
  }
  return {};
}

}  // namespace

QuantisedVertex quantised_place(const Vec3d& place_m) {
  const auto rounded = [](double metres) {
    constexpr double kMost = kMostThreadQuanta;
    const double quanta = metres / static_cast<double>(kQuantumMetres);
    return static_cast<std::int32_t>(std::floor(std::clamp(quanta, -kMost, kMost) + 0.5));
  };
  return {rounded(place_m.x), rounded(place_m.y), rounded(place_m.z)};
}

void encode_threads(const ThreadPicture& picture, Bytes& out) {
  TROCAR_ASSERT(picture.is_joined.size() == picture.places.size());
  put_varint(out, picture.threads.size());
  for (const auto& thread : picture.threads) {
    put_varint(out, thread.nodes);
    out.push_back(thread.material);
  }
  put_varint(out, picture.pegs.size());
  for (const auto& peg : picture.pegs)
    for (const auto value :
         {peg.from.x, peg.from.y, peg.from.z, peg.to.x, peg.to.y, peg.to.z, peg.radius})
      put_varint(out, zigzag(value));
  // The last node of a thread is joined to none anyway.
  auto is_end = std::vector<std::uint8_t>(picture.places.size());
  std::size_t end = 0;
  for (const auto& thread : picture.threads) is_end[(end += thread.nodes) - 1] = 1;
  std::vector<std::size_t> parted;
  for (std::size_t i = 0; i < picture.places.size(); ++i)
    if (picture.is_joined[i] == 0 && is_end[i] == 0) parted.push_back(i);
  put_varint(out, parted.size());
  std::size_t last = 0;
  for (const auto node : parted) {
    put_varint(out, node - last);
    last = node;
  }
  put_places(picture.places, out);
}

Result<ThreadPicture> decode_threads(BytesView payload) {
  ThreadPicture picture;
  ByteReader reader(payload);
  if (auto s = get_threads(reader, picture); !s) return s.error();
  if (auto s = get_pegs(reader, picture); !s) return s.error();
  if (auto s = get_parted(reader, picture); !s) return s.error();
  const auto rest = payload.subspan(reader.position());
  if (auto s = get_places(rest, picture.places); !s) return s.error();
  return picture;
}

}  // namespace trocar::wire
