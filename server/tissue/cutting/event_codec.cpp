#include "server/tissue/cutting/event_codec.h"

#include <algorithm>

#include "common/base/assert.h"
#include "common/base/varint.h"

namespace trocar::cutting {
namespace {

// Kinds of events, in the two low bits of a number; the length of the run of that kind is above.
enum Kind : std::uint64_t { kSplit, kOpen, kDuplicate, kMove };

constexpr std::int64_t kMost = 0xffffffff;
constexpr std::uint64_t kMostNumber = (std::uint64_t{1} << 42) - 1;

// The next numbers are stored as differences from these.
struct Last {
  std::int64_t made = 0;  // node
  std::int64_t a = 0, original = 0, face = 0, moved = 0;
};

Kind kind_of(const CutEvent& event) {
  return static_cast<Kind>(event.index());
}
std::int64_t number_of(const TetFace& face) {
  return static_cast<std::int64_t>(face.tet.value) * 4 + face.corner;
}

// Writes the number's difference from `last`, with the sign in the lowest bit, and updates `last`.
void put_difference(std::int64_t number, std::int64_t& last, Bytes& out) {
  const auto difference = number - last;
  put_varint(out,
             static_cast<std::uint64_t>(difference < 0 ? -2 * difference - 1 : 2 * difference));
  last = number;
}

class Encoder {
 public:
  Encoder(const CutEvents& events, Bytes& out) : events_(events), out_(out) {}

  void put_event(const Split& split) {
    put_difference(split.a.value, last_.a, out_);
    auto near = last_.a;
    put_difference(split.b.value, near, out_);
    put_share(split.t);
    put_difference(split.node.value, last_.made, out_);
  }
  void put_event(const Open& open) {
    put_varint(out_, open.face_count);
    for (const auto& face : std::span(events_.faces).subspan(open.first_face, open.face_count)) {
      TROCAR_ASSERT(face.corner < 4);
      put_difference(number_of(face), last_.face, out_);
    }
  }
  void put_event(const Duplicate& duplicate) {
    put_difference(duplicate.node.value, last_.original, out_);
    put_difference(duplicate.copy.value, last_.made, out_);
  }
  void put_event(const Move& move) {
    put_difference(move.node.value, last_.moved, out_);
    auto near = last_.moved;
    put_difference(move.toward.value, near, out_);
    put_share(move.t);
  }

 private:
  void put_share(std::uint16_t t) {
    out_.push_back(static_cast<std::uint8_t>(t));
    out_.push_back(static_cast<std::uint8_t>(t >> 8));
  }

  const CutEvents& events_;
  Bytes& out_;
  Last last_;
};

class Decoder {
 public:
  explicit Decoder(BytesView bytes) : reader_(bytes) {}

  std::optional<CutEvents> run() {
    while (ok() && reader_.remaining() > 0) {
      const auto run = number();
      const auto kind = run & 3;
      for (auto left = run >> 2; ok() && left > 0; --left) take_event(kind);
    }
    if (!ok()) return std::nullopt;
    return std::move(events_);
  }

 private:
  bool ok() const { return ok_ && reader_.ok(); }

  std::uint64_t number() {
    const auto number = read_varint(reader_, kMostNumber);
    if (!number) ok_ = false;
    return number.value_or(0);
  }
  std::int64_t after(std::int64_t& last, std::int64_t most = kMost) {
    const auto coded = number();
    const auto half = static_cast<std::int64_t>((coded + 1) / 2);
    last += coded % 2 == 0 ? half : -half;
    if (last < 0 || last > most) {
      ok_ = false;
      last = 0;
    }
    return last;
  }
  NodeIndex node_after(std::int64_t& last) {
    return NodeIndex(static_cast<std::uint32_t>(after(last)));
  }

  void take_event(std::uint64_t kind) {
    if (kind == kSplit) {
      Split split;
      split.a = node_after(last_.a);
      auto near = last_.a;
      split.b = node_after(near);
      split.t = reader_.read<std::uint16_t>();
      split.node = node_after(last_.made);
      events_.events.emplace_back(split);
    } else if (kind == kOpen) {
      take_open();
    } else if (kind == kDuplicate) {
      const auto original = node_after(last_.original);
      events_.events.emplace_back(Duplicate{original, node_after(last_.made)});
    } else {
      Move move;
      move.node = node_after(last_.moved);
      auto near = last_.moved;
      move.toward = node_after(near);
      move.t = reader_.read<std::uint16_t>();
      events_.events.emplace_back(move);
    }
  }
  void take_open() {
    const auto first = static_cast<std::uint32_t>(events_.faces.size());
    for (auto left = number(); ok() && left > 0; --left) {
      const auto face = static_cast<std::uint64_t>(after(last_.face, 4 * kMost + 3));
      events_.faces.push_back({TetIndex(face / 4), static_cast<std::uint8_t>(face % 4)});
    }
    const auto end = static_cast<std::uint32_t>(events_.faces.size());
    events_.events.emplace_back(Open{first, end - first});
  }

  ByteReader reader_;
  bool ok_ = true;
  Last last_;
  CutEvents events_;
};

}  // namespace

void encode(const CutEvents& events, Bytes& out) {
  Encoder encoder(events, out);
  for (auto at = events.events.begin(); at != events.events.end();) {
    const auto kind = kind_of(*at);
    const auto end = std::find_if(at, events.events.end(),
                                  [&](const CutEvent& event) { return kind_of(event) != kind; });
    put_varint(out, static_cast<std::uint64_t>(end - at) << 2 | kind);
    for (; at != end; ++at) std::visit([&](const auto& event) { encoder.put_event(event); }, *at);
  }
}

std::optional<CutEvents> decode(BytesView bytes) {
  return Decoder(bytes).run();
}

void visit_state(world::StateArchive& archive, CutEvents& events) {
  Bytes bytes;
  if (!archive.is_reading()) encode(events, bytes);
  archive.sized_array(bytes, kMaxEventBytes);
  if (!archive.is_reading()) return;
  auto read = archive.ok() ? decode(bytes) : std::nullopt;
  if (!read) archive.fail();
  events = read ? std::move(*read) : CutEvents{};
}

}  // namespace trocar::cutting
