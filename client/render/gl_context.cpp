#include "client/render/gl_context.h"

#include <algorithm>
#include <cstring>

#include "client/render/gl.h"
#include "common/base/text_file.h"
#include "common/image/image.h"

namespace trocar::render {

std::string GlContext::renderer_name() const {
  const auto* name = reinterpret_cast<const char*>(glGetString(GL_RENDERER));
  return name != nullptr ? name : "unknown renderer";
}

bool GlContext::is_software() const {
  const std::string name = renderer_name();
  return name.find("llvmpipe") != std::string::npos || name.find("softpipe") != std::string::npos;
}

Image GlContext::read_image() const {
  Image image;
  image.size = size();
  const auto width = static_cast<std::size_t>(image.size.width);
  const auto height = static_cast<std::size_t>(image.size.height);
  std::vector<std::uint8_t> rgba(width * height * 4);
  glBindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer());
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glReadPixels(0, 0, image.size.width, image.size.height, GL_RGBA, GL_UNSIGNED_BYTE, rgba.data());
  image.rgb.resize(width * height * 3);
  for (std::size_t y = 0; y < height; ++y)  // OpenGL's first row is the lowest
    for (std::size_t x = 0; x < width; ++x)
      std::memcpy(&image.rgb[(y * width + x) * 3], &rgba[((height - 1 - y) * width + x) * 4], 3);
  return image;
}

Status write_png(const Image& image, const std::string& path) {
  const auto file = image::encode_png(image.size.width, image.size.height, image.rgb);
  if (!file) return file.error();
  return write_text_file(path, *file);
}

}  // namespace trocar::render
