#include "common/base/inflate.h"

#include <zlib.h>

namespace trocar {

Status inflate_into(std::string_view packed, Packing packing, std::size_t most_bytes,
                    std::string& out) {
  constexpr int kGzipHeader = 16;  // to be added, zlib.h says
  z_stream stream{};
  if (inflateInit2(&stream, MAX_WBITS + (packing == Packing::Gzip ? kGzipHeader : 0)) != Z_OK)
    return Error{ErrorCode::ResourceMissing, "zlib cannot be started"};
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  int result = Z_OK;
  char chunk[65536];
  while (result == Z_OK && out.size() <= most_bytes) {
    stream.next_out = reinterpret_cast<Bytef*>(chunk);
    stream.avail_out = sizeof chunk;
    result = inflate(&stream, Z_NO_FLUSH);
    out.append(chunk, sizeof chunk - stream.avail_out);
    // A gzip file may have several members, and zeros behind them.
    const bool has_more = result == Z_STREAM_END && packing == Packing::Gzip &&
                          stream.avail_in > 0 && *stream.next_in != 0;
    if (has_more) result = inflateReset(&stream);
  }
  inflateEnd(&stream);
  if (out.size() > most_bytes) return Error{ErrorCode::BadFile, "unpacks to too many bytes"};
  if (result == Z_STREAM_END) return {};
  return Error{ErrorCode::BadFile, "packed data are damaged or cut off"};
}

}  // namespace trocar
