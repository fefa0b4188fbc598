#include "server/organs/picture/png.h"

#include <zlib.h>

#include <cstddef>

namespace trocar::picture {
namespace {

void put_big_endian(std::string& out, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) out += static_cast<char>(value >> shift & 0xff);
}

void put_chunk(std::string& out, const std::string& kind, const std::string& content) {
  put_big_endian(out, static_cast<std::uint32_t>(content.size()));
  const std::string body = kind + content;
  out += body;
  put_big_endian(out,
                 static_cast<std::uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(body.data()),
                                                  static_cast<uInt>(body.size()))));
}

}  // namespace

std::string to_png(const Picture& picture) {
  std::string rows;
  for (int y = 0; y < picture.height; ++y) {
    rows += '\0';  // the row is not filtered
    const auto first = static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width);
    rows.append(reinterpret_cast<const char*>(picture.pixels.data() + first),
                3 * static_cast<std::size_t>(picture.width));
  }
  std::string header;
  put_big_endian(header, static_cast<std::uint32_t>(picture.width));
  put_big_endian(header, static_cast<std::uint32_t>(picture.height));
  header += std::string("\x08\x02\0\0\0", 5);
  uLongf size = compressBound(rows.size());
  std::string packed(size, '\0');
  compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
            reinterpret_cast<const Bytef*>(rows.data()), rows.size(), 9);
  packed.resize(size);
  std::string out = "\x89PNG\r\n\x1a\n";
  put_chunk(out, "IHDR", header);
  put_chunk(out, "IDAT", packed);
  put_chunk(out, "IEND", "");
  return out;
}

}  // namespace trocar::picture
