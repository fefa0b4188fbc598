#include "client/render/image_texture.h"

#include "client/render/gl.h"

#define STB_IMAGE_IMPLEMENTATION
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_NO_STDIO
#define STBI_MAX_DIMENSIONS 2048
#include <stb_image.h>

namespace trocar::render {

static_assert(kMostImageSide == STBI_MAX_DIMENSIONS);

Status ImageTexture::load(const std::string& bytes) {
  clear();
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
