#pragma once

// The shaders that draw the organ, by side and by how much detail is drawn, with the patterns that
// they look up. Needs a current OpenGL context for its whole life. Thread: render thread.

#include <array>
#include <cstdint>
#include <string_view>

#include "client/render/shader.h"
#include "client/shape/tissue_look.h"

namespace trocar::render {

// Plain is for software. Near adds what only an eye that is near sees.
enum class Detail : std::uint8_t { Plain, PlainNear, Fine };
// The inside is what a blade has laid open.
enum class Side : std::uint8_t { Outside, Inside };

class OrganShaders {
 public:
  OrganShaders();
  ~OrganShaders();
  OrganShaders(const OrganShaders&) = delete;
  OrganShaders& operator=(const OrganShaders&) = delete;

  // From here on the organ looks as one of this name.
  void take_look(const shape::TissueLook& look);
  // Makes one ready to draw, with its pattern in texture unit 0. Light and shadows are left to do.
  const Shader& use(Side side, Detail detail) const;
  // Draws the backs of triangles.
  const Shader& backs() const { return backs_; }

 private:
  std::array<std::array<Shader, 3>, 2> shaders_;
  Shader backs_;
  std::array<unsigned, 2> patterns_{};
  std::array<shape::LookFigures, 2> figures_{};
};

}  // namespace trocar::render
