#include "server/organs/organ/packed_file.h"

#include <zstd.h>

#include <algorithm>
#include <fstream>
#include <memory>

#include "common/base/checksum.h"
#include "common/base/unfinished_file.h"
#include "common/budget/message_budget.h"
#include "server/organs/organ/bad_file.h"

namespace trocar::organ {
namespace {

constexpr std::size_t kHeaderBytes = 24;
constexpr std::size_t kUnpackStepBytes = std::size_t{1} << 20;
constexpr int kCompressionLevel = 9;

struct FreeZstd {
  void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
};

// Grows with what is really there: a short file that announces 512 MiB takes no such memory.
// It also ends where it has grown beyond what a file of its size may build.
Result<Bytes> unpack_body(BytesView packed, std::uint64_t announced, std::size_t budget) {
  const std::unique_ptr<ZSTD_DCtx, FreeZstd> context(ZSTD_createDCtx());
  TROCAR_ASSERT(context != nullptr);
  Bytes body;
  ZSTD_inBuffer in{packed.data(), packed.size(), 0};
  std::size_t wanted = 1;
  while (wanted != 0) {
    const std::size_t before = body.size();
    // One byte more than announced, to notice a body that is longer.
    const auto room = std::min<std::uint64_t>(kUnpackStepBytes, announced + 1 - before);
    if (room == 0) return bad("body is longer than announced");
    if (before > budget)
      return bad("unpacks to more than " + std::to_string(budget >> 20) +
                 " MiB, 16 times its size and 16 MiB: it is damaged or made to harm");
    body.resize(before + static_cast<std::size_t>(room));
    ZSTD_outBuffer out{body.data() + before, body.size() - before, 0};
    const std::size_t read_before = in.pos;
    wanted = ZSTD_decompressStream(context.get(), &out, &in);
    body.resize(before + out.pos);
    if (ZSTD_isError(wanted)) return bad("body cannot be unpacked, the file is damaged");
    if (out.pos == 0 && in.pos == read_before) return bad("body is cut off");
  }
  if (body.size() != announced) return bad("body has another length than announced");
  if (in.pos != packed.size()) return bad("has bytes behind its body");
  return body;
}

}  // namespace

Bytes pack(const PackedKind& kind, std::uint32_t version, const Bytes& body) {
  TROCAR_ASSERT(body.size() <= kMaxPackedBodyBytes);
  Bytes header;
  ByteWriter writer(header);
  writer.put_bytes(bytes_of(kind.magic));
  writer.put(version);
  writer.put(static_cast<std::uint64_t>(body.size()));
  writer.put(crc32(body));
  TROCAR_ASSERT(header.size() == kHeaderBytes);
  Bytes file(kHeaderBytes + ZSTD_compressBound(body.size()));
  std::copy(header.begin(), header.end(), file.begin());
  const std::size_t packed = ZSTD_compress(file.data() + kHeaderBytes, file.size() - kHeaderBytes,
                                           body.data(), body.size(), kCompressionLevel);
  TROCAR_ASSERT(!ZSTD_isError(packed));
  file.resize(kHeaderBytes + packed);
  return file;
}

bool has_magic(BytesView file, std::string_view magic) {
  return file.size() >= magic.size() &&
         std::ranges::equal(file.first(magic.size()), bytes_of(magic));
}

Result<PackedBody> unpack(const PackedKind& kind, BytesView file) {
  ByteReader reader(file);
  reader.read_bytes(kind.magic.size());
  const auto version = reader.read<std::uint32_t>();
  const auto length = reader.read<std::uint64_t>();
  const auto crc = reader.read<std::uint32_t>();
  if (!has_magic(file, kind.magic))
    return bad("is not " + std::string(kind.name) + ": " + std::string(kind.remedy));
  if (!reader.ok()) return bad("is cut off in its header");
  if (version < kind.first_version || version > kind.last_version)
    return bad("has version " + std::to_string(version) + ", this program reads version" +
               (kind.first_version == kind.last_version
                    ? " "
                    : "s " + std::to_string(kind.first_version) + " and ") +
               std::to_string(kind.last_version) + ": " + std::string(kind.again));
  if (length > kMaxPackedBodyBytes) return bad("announces more than 512 MiB");
  auto body = unpack_body(file.subspan(kHeaderBytes), length, build_budget(file.size()));
  if (!body) return body.error();
  if (crc32(*body) != crc) return bad("is damaged, its checksum does not fit");
  return PackedBody{version, std::move(*body)};
}

Status write_packed(const std::filesystem::path& path, BytesView file) {
  return write_whole_file(path.string(), {reinterpret_cast<const char*>(file.data()), file.size()});
}

Result<Bytes> read_packed(const std::filesystem::path& path) {
  std::error_code failure;
  const auto size = std::filesystem::file_size(path, failure);
  if (failure) return bad(path.string() + ": cannot be opened: " + failure.message());
  if (size > kMaxPackedBodyBytes) return bad(path.string() + ": is larger than 512 MiB");
  Bytes file(static_cast<std::size_t>(size));
  std::ifstream in(path, std::ios::binary);
  in.read(reinterpret_cast<char*>(file.data()), static_cast<std::streamsize>(file.size()));
  if (!in) return bad(path.string() + ": cannot be read");
  return file;
}

}  // namespace trocar::organ
