#include "common/image/image.h"

#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>

namespace {

// A picture of the largest side takes half of it, at 16 bits a channel; what unpacks to more is no
// picture.
constexpr std::size_t kMostPictureMemory = std::size_t{64} << 20;

void* take_memory(std::size_t bytes) {
  return bytes > kMostPictureMemory ? nullptr : std::malloc(bytes);
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

}  // namespace

Result<Image> decode(std::string_view file) {
  if (file.starts_with("\xff\xd8") && !has_few_scans(file))
    return Error{ErrorCode::BadFile,
                 "picture: a JPEG of more than " + std::to_string(kMostScans) + " scans"};
  if (file.size() > kMostPictureMemory)
    return Error{ErrorCode::BadFile, "picture: a file of more than 64 MiB"};
  Image image;
  int channels = 0;
  const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(
      stbi_load_from_memory(reinterpret_cast<const stbi_uc*>(file.data()),
                            static_cast<int>(file.size()), &image.width, &image.height, &channels,
                            4),
      stbi_image_free);
  if (!pixels) return Error{ErrorCode::BadFile, std::string("picture: ") + stbi_failure_reason()};
  image.pixels.resize(static_cast<std::size_t>(image.width) *
                      static_cast<std::size_t>(image.height));
  std::memcpy(image.pixels.data(), pixels.get(), image.pixels.size() * sizeof(Pixel));
  return image;
}

}  // namespace trocar::image
