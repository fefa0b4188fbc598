#pragma once

// One GLSL 3.30 program. Source text is ours and compiled at start, so a failure is our bug (or a
// driver's) and is asserted with the compiler's log.

#include <span>

#include "client/render/camera.h"
#include "client/render/gl.h"

namespace trocar::render {

class Shader {
 public:
  // Attribute locations are set in the source with layout(location = n).
  Shader(const char* vertex_source, const char* fragment_source);
  ~Shader();
  Shader(const Shader&) = delete;
  Shader& operator=(const Shader&) = delete;

  void use() const;
  void set(const char* name, float value) const;
  void set(const char* name, int value) const;
  void set(const char* name, float x, float y) const;
  void set(const char* name, const Vec3f& value) const;
  void set(const char* name, const Matrix4& value) const;
  // The uniform is an array of vec4.
  void set_array(const char* name, const float* values, int count) const;
  // The uniform is an array of vec3.
  void set_array(const char* name, std::span<const Vec3f> values) const;

 private:
  GLuint program_ = 0;
};

}  // namespace trocar::render
