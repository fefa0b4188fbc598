#pragma once

// Framed Envelopes go over the bus, one or several at a time, cut into pieces that the bus takes.
// A piece is in little-endian:
//
//   "TRC1"  u64 publisher  u64 number  u32 piece  u32 pieces  bytes
//
// `publisher` is a random number of the process that publishes. `number` counts what it has
// published to everybody, from 1; an answer has the number of the newest that it holds. `pieces` is
// 0 in a sign of life, which says the newest number and nothing else.
//
// Outside data: everything is checked, and what does not fit is an error. Thread: one.

#include <cstdint>
#include <optional>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/wire/framing.h"

namespace trocar::bus {

inline constexpr std::size_t kPieceHeaderBytes = 28;
inline constexpr std::size_t kMostPieceBytes = 128 * 1024;  // with its header
// All pieces together have no more: a surface, its picture and its fine parts fit several times.
inline constexpr std::size_t kMostWholeBytes = 4 * std::size_t{wire::kMaxDownstreamBytes};

struct Piece {
  std::uint64_t publisher = 0, number = 0;
  std::uint32_t piece = 0, pieces = 0;  // piece < pieces, or both are 0
  BytesView bytes;                      // of who was read
};

Bytes write_piece(const Piece& piece);
Result<Piece> read_piece(BytesView bytes);
// Returns all pieces of `whole`, each of `most_bytes` at most with its header.
std::vector<Bytes> cut(std::uint64_t publisher, std::uint64_t number, BytesView whole,
                       std::size_t most_bytes);

// Puts pieces together that come one after the other.
class Assembler {
 public:
  // Returns the whole with its last piece, until then nothing. A first piece begins anew; an error:
  // the piece does not follow the one before, or it is too much.
  Result<std::optional<Bytes>> add(const Piece& piece);

 private:
  std::uint64_t publisher_ = 0, number_ = 0;
  std::uint32_t next_ = 0, pieces_ = 0;
  Bytes whole_;
};

// Returns each framed message of a whole, with its length. An error: these are no messages.
Result<std::vector<BytesView>> split_messages(BytesView whole);

}  // namespace trocar::bus
