#include "client/render/image_texture.h"

#include "client/render/gl.h"
#include "common/image/image.h"

namespace trocar::render {
static_assert(kMostImageSide == image::kMostSide);

Status ImageTexture::load(const std::string& bytes) {
  clear();
  const auto image = image::decode(bytes);
  if (!image) return image.error();
  width_ = image->width;
  height_ = image->height;
  glGenTextures(1, &name_);
  glBindTexture(GL_TEXTURE_2D, name_);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, width_, height_, 0, GL_RGBA, GL_UNSIGNED_BYTE,
               image->pixels.data());
  glGenerateMipmap(GL_TEXTURE_2D);
  glBindTexture(GL_TEXTURE_2D, 0);
  return {};
}

void ImageTexture::clear() {
  if (name_ != 0) glDeleteTextures(1, &name_);
  name_ = 0;
  width_ = height_ = 0;
}

}  // namespace trocar::render
