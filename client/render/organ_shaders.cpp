#include "client/render/organ_shaders.h"

#include <string>

#include "client/render/gl.h"
#include "client/render/shader_sources.h"
#include "client/shape/noise.h"

namespace trocar::render {
namespace {

constexpr int kPatternSize = 64;

Shader organ_shader(Side side, Detail detail) {
  std::string source = detail == Detail::Fine ? kFineHead : kPlainHead;
  if (detail != Detail::Plain) source += kNearHead;
  if (side == Side::Inside) source += kInsideHead;
  source += kLightingSource;
  source += kOrganFragmentSource;
  return Shader(kOrganVertexSource, source.c_str());
}

std::array<Shader, 3> organ_shaders(Side side) {
  return {organ_shader(side, Detail::Plain), organ_shader(side, Detail::PlainNear),
          organ_shader(side, Detail::Fine)};
}

unsigned make_pattern(const std::vector<std::uint8_t>& texels) {
  unsigned name = 0;
  glGenTextures(1, &name);
  glBindTexture(GL_TEXTURE_3D, name);
  glTexImage3D(GL_TEXTURE_3D, 0, GL_RGBA8, kPatternSize, kPatternSize, kPatternSize, 0, GL_RGBA,
               GL_UNSIGNED_BYTE, texels.data());
  glTexParameteri(GL_TEXTURE_3D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  // Mip maps cost a software rasteriser a second look-up, and the pattern is never much smaller
  // than a pixel.
  glTexParameteri(GL_TEXTURE_3D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  return name;
}

}  // namespace

OrganShaders::OrganShaders()
    : shaders_{organ_shaders(Side::Outside), organ_shaders(Side::Inside)},
      backs_(kOrganVertexSource,
             (std::string(kPlainHead) + kLightingSource + kBackFragmentSource).c_str()),
      patterns_{make_pattern(shape::make_tissue_noise(kPatternSize)),
                make_pattern(shape::make_lobule_noise(kPatternSize))} {
  take_look(shape::kTissueLooks.front());
}

OrganShaders::~OrganShaders() {
  glDeleteTextures(2, patterns_.data());
}

void OrganShaders::take_look(const shape::TissueLook& look) {
  figures_ = {shape::outside_figures(look), shape::inside_figures(look)};
}

const Shader& OrganShaders::use(Side side, Detail detail) const {
  const auto number = static_cast<std::size_t>(side);
  const Shader& shader = shaders_[number][static_cast<std::size_t>(detail)];
  const shape::LookFigures& look = figures_[number];
  shader.use();
  shader.set("noise", 0);
  shader.set("picture", 1);
  shader.set("has_picture", 0);
  shader.set_array("part_dark", look.dark);
  shader.set_array("part_light", look.light);
  shader.set_array("lines", look.lines.data(), 1);
  shader.set_array("figures", look.figures.data(), 1);
  glActiveTexture(GL_TEXTURE0);
  glBindTexture(GL_TEXTURE_3D, patterns_[number]);
  return shader;
}

}  // namespace trocar::render
