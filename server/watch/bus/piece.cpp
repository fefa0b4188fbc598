#include "server/watch/bus/piece.h"

#include <algorithm>

#include "common/base/assert.h"

namespace trocar::bus {
namespace {

constexpr std::uint32_t kMagic = 0x3143'5254;  // "TRC1"

Error wrong(const std::string& what) {
  return {ErrorCode::BadMessage, "piece: " + what};
}

}  // namespace

Bytes write_piece(const Piece& piece) {
  Bytes bytes;
  bytes.reserve(kPieceHeaderBytes + piece.bytes.size());
  ByteWriter writer(bytes);
  writer.put(kMagic);
  writer.put(piece.publisher);
  writer.put(piece.number);
  writer.put(piece.piece);
  writer.put(piece.pieces);
  writer.put_bytes(piece.bytes);
  return bytes;
}

Result<Piece> read_piece(BytesView bytes) {
  ByteReader reader(bytes);
  const auto magic = reader.read<std::uint32_t>();
  Piece piece;
  piece.publisher = reader.read<std::uint64_t>();
  piece.number = reader.read<std::uint64_t>();
  piece.piece = reader.read<std::uint32_t>();
  piece.pieces = reader.read<std::uint32_t>();
  if (!reader.ok() || magic != kMagic) return wrong("is none of a session, or of another release");
  piece.bytes = bytes.subspan(kPieceHeaderBytes);
  if (piece.pieces == 0 && (piece.piece != 0 || !piece.bytes.empty()))
    return wrong("a sign of life has no content");
  if (piece.pieces > 0 && (piece.piece >= piece.pieces || piece.bytes.empty()))
    return wrong(std::to_string(piece.piece) + " of " + std::to_string(piece.pieces) + " with " +
                 std::to_string(piece.bytes.size()) + " bytes");
  return piece;
}

std::vector<Bytes> cut(std::uint64_t publisher, std::uint64_t number, BytesView whole,
                       std::size_t most_bytes) {
  TROCAR_ASSERT(!whole.empty() && most_bytes > kPieceHeaderBytes);
  const auto size = most_bytes - kPieceHeaderBytes;
  const auto pieces = static_cast<std::uint32_t>((whole.size() + size - 1) / size);
  Piece piece{.publisher = publisher, .number = number, .pieces = pieces, .bytes = {}};
  std::vector<Bytes> all;
  for (; piece.piece < piece.pieces; ++piece.piece) {
    const auto begin = piece.piece * size;
    piece.bytes = whole.subspan(begin, std::min(size, whole.size() - begin));
    all.push_back(write_piece(piece));
  }
  return all;
}

Result<std::optional<Bytes>> Assembler::add(const Piece& piece) {
  if (piece.piece == 0) {
    publisher_ = piece.publisher;
    number_ = piece.number;
    pieces_ = piece.pieces;
    next_ = 0;
    whole_.clear();
  }
  const bool follows = piece.publisher == publisher_ && piece.number == number_ &&
                       piece.pieces == pieces_ && piece.piece == next_;
  const bool is_too_much = whole_.size() + piece.bytes.size() > kMostWholeBytes;
  if (!follows || is_too_much) {
    *this = {};
    return wrong(is_too_much ? "more than " + std::to_string(kMostWholeBytes) + " bytes together"
                             : "does not follow the one before");
  }
  whole_.insert(whole_.end(), piece.bytes.begin(), piece.bytes.end());
  if (++next_ < pieces_) return std::optional<Bytes>();
  return std::optional(std::move(std::exchange(*this, {}).whole_));
}

Result<std::vector<BytesView>> split_messages(BytesView whole) {
  std::vector<BytesView> all;
  while (!whole.empty()) {
    if (whole.size() < wire::kHeaderBytes) return wrong("ends within the length of a message");
    const auto length =
        wire::decode_length(whole.first<wire::kHeaderBytes>(), wire::kMaxDownstreamBytes);
    if (!length) return length.error();
    if (whole.size() < wire::kHeaderBytes + *length) return wrong("ends within a message");
    all.push_back(whole.first(wire::kHeaderBytes + *length));
    whole = whole.subspan(all.back().size());
  }
  return all;
}

}  // namespace trocar::bus
