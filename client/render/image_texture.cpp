#include "client/render/image_texture.h"

#include <cstdlib>
#include <string_view>

#include "client/render/gl.h"

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
#include <stb_image.h>

namespace trocar::render {

static_assert(kMostImageSide == STBI_MAX_DIMENSIONS);

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

Status ImageTexture::load(const std::string& bytes) {
  clear();
  if (bytes.starts_with("\xff\xd8") && !has_few_scans(bytes))
    return Error{ErrorCode::BadFile,
                 "picture: a JPEG of more than " + std::to_string(kMostScans) + " scans"};
  int channels = 0;
  stbi_uc* pixels =
      stbi_load_from_memory(reinterpret_cast<const stbi_uc*>(bytes.data()),
                            static_cast<int>(bytes.size()), &width_, &height_, &channels, 4);
  if (pixels == nullptr) {
    width_ = height_ = 0;
    return Error{ErrorCode::BadFile, std::string("picture: ") + stbi_failure_reason()};
  }
  glGenTextures(1, &name_);
  glBindTexture(GL_TEXTURE_2D, name_);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, width_, height_, 0, GL_RGBA, GL_UNSIGNED_BYTE, pixels);
  glGenerateMipmap(GL_TEXTURE_2D);
  glBindTexture(GL_TEXTURE_2D, 0);
  stbi_image_free(pixels);
  return {};
}

void ImageTexture::clear() {
  if (name_ != 0) glDeleteTextures(1, &name_);
  name_ = 0;
  width_ = height_ = 0;
}

}  // namespace trocar::render
