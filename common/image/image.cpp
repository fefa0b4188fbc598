#include "common/image/image.h"

#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>

namespace {

// A picture of the largest side takes half of it, at 16 bits a channel; what unpacks to more is no
// picture.
constexpr std::size_t kMostPictureMemory = std::size_t{64} << 20;

// The memory is zero: the library reads tables that a file names and does not hold.
void* take_memory(std::size_t bytes) {
  return bytes > kMostPictureMemory ? nullptr : std::calloc(1, bytes);
}

void* take_more_memory(void* from, std::size_t bytes) {
  return bytes > kMostPictureMemory ? nullptr : std::realloc(from, bytes);
}

}  // namespace

#define STBI_MALLOC(bytes) take_memory(bytes)
#define STBI_REALLOC_SIZED(from, old_bytes, bytes) take_more_memory(from, bytes)
#define STBI_FREE(from) std::free(from)
#define STB_IMAGE_IMPLEMENTATION
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_NO_STDIO
#define STBI_MAX_DIMENSIONS 2048
#include <stb/stb_image.h>

#include "common/base/printable.h"

namespace trocar::image {

static_assert(kMostSide == STBI_MAX_DIMENSIONS);

namespace {

// Each scan of a JPEG goes over the whole picture, whatever bytes it has; encoders write about ten.
constexpr int kMostScans = 100;

// Counts the markers that begin a scan. Within a scan's data there is none: a byte of 0xff is
// followed by 0 there (ISO/IEC 10918-1, B.1.1.5).
bool has_few_scans(std::string_view bytes) {
  int scans = 0;
  for (auto at = bytes.find("\xff\xda"); at != std::string_view::npos && scans <= kMostScans;
       at = bytes.find("\xff\xda", at + 2))
    ++scans;
  return scans <= kMostScans;
}

// Some tables for each scan are usual. The bound keeps the look at them short.
constexpr int kMostTables = 1000;

// Each table of Huffman codes begins with how many there are of each length. The library trusts
// their sum and writes beyond its own table where that is more than 256, and it has no number for
// the last of 256 that have 9 bits at most. A table stands behind a marker, as a scan does
// (B.2.4.2); with a wrong class or number it ends the file for the library.
bool has_sound_tables(std::string_view bytes) {
  const auto byte = [&](std::size_t at) {
    return at < bytes.size() ? static_cast<unsigned char>(bytes[at]) : 0u;
  };
  int tables = 0;
  for (auto marker = bytes.find("\xff\xc4"); marker != std::string_view::npos;
       marker = bytes.find("\xff\xc4", marker + 2)) {
    if (++tables > kMostTables) return false;
    const std::size_t end = marker + 2 + (byte(marker + 2) << 8) + byte(marker + 3);
    for (std::size_t at = marker + 4; at < end;) {
      if ((byte(at) & 0xf0) > 0x10 || (byte(at) & 0x0f) > 3) break;
      std::size_t codes = 0, short_codes = 0;
      for (std::size_t length = 1; length <= 16; ++length) {
        codes += byte(at + length);
        if (length <= 9) short_codes = codes;
      }
      if (codes > 256 || short_codes > 255) return false;
      at += 17 + codes;
    }
  }
  return true;
}

}  // namespace

Result<Image> decode(std::string_view file) {
  // The library skips bytes of 0xff before the marker that makes it a JPEG.
  const bool may_be_jpeg = file.starts_with('\xff');
  if (may_be_jpeg && !has_few_scans(file))
    return Error{ErrorCode::BadFile,
                 "picture: a JPEG of more than " + std::to_string(kMostScans) + " scans"};
  if (may_be_jpeg && !has_sound_tables(file))
    return Error{ErrorCode::BadFile,
                 "picture: a JPEG with a table of more than 256 codes, or too many tables"};
  if (file.size() > kMostPictureMemory)
    return Error{ErrorCode::BadFile, "picture: a file of more than 64 MiB"};
  Image image;
  int channels = 0;
  const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(
      stbi_load_from_memory(reinterpret_cast<const stbi_uc*>(file.data()),
                            static_cast<int>(file.size()), &image.width, &image.height, &channels,
                            4),
      stbi_image_free);
  if (!pixels) {
    // It may hold bytes of the file, such as the name of a chunk.
    const char* why = stbi_failure_reason();
    return Error{ErrorCode::BadFile,
                 "picture: " + printable(why != nullptr ? why : "cannot be read", 80)};
  }
  image.pixels.resize(static_cast<std::size_t>(image.width) *
                      static_cast<std::size_t>(image.height));
  std::memcpy(image.pixels.data(), pixels.get(), image.pixels.size() * sizeof(Pixel));
  return image;
}

}  // namespace trocar::image
