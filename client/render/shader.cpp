#include "client/render/shader.h"

#include <cstdio>

#include "common/base/assert.h"

namespace trocar::render {
namespace {

GLuint compile(GLenum kind, const char* source) {
  const GLuint shader = glCreateShader(kind);
  glShaderSource(shader, 1, &source, nullptr);
  glCompileShader(shader);
  GLint compiled = GL_FALSE;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
  if (compiled != GL_TRUE) {
    char text[2048] = "";
    glGetShaderInfoLog(shader, sizeof text, nullptr, text);
    std::fprintf(stderr, "%s\n", text);
    TROCAR_ASSERT(compiled == GL_TRUE);
  }
  return shader;
}

}  // namespace

Shader::Shader(const char* vertex_source, const char* fragment_source) {
  const GLuint vertex = compile(GL_VERTEX_SHADER, vertex_source);
  const GLuint fragment = compile(GL_FRAGMENT_SHADER, fragment_source);
  program_ = glCreateProgram();
  glAttachShader(program_, vertex);
  glAttachShader(program_, fragment);
  glLinkProgram(program_);
  GLint linked = GL_FALSE;
  glGetProgramiv(program_, GL_LINK_STATUS, &linked);
  TROCAR_ASSERT(linked == GL_TRUE);
  glDeleteShader(vertex);
  glDeleteShader(fragment);
}

Shader::~Shader() {
  glDeleteProgram(program_);
}

void Shader::use() const {
  glUseProgram(program_);
}

void Shader::set(const char* name, float value) const {
  glUniform1f(glGetUniformLocation(program_, name), value);
}
void Shader::set(const char* name, float x, float y) const {
  glUniform2f(glGetUniformLocation(program_, name), x, y);
}
void Shader::set(const char* name, int value) const {
  glUniform1i(glGetUniformLocation(program_, name), value);
}
void Shader::set(const char* name, const Vec3f& value) const {
  glUniform3f(glGetUniformLocation(program_, name), value.x, value.y, value.z);
}
void Shader::set(const char* name, const Matrix4& value) const {
  glUniformMatrix4fv(glGetUniformLocation(program_, name), 1, GL_FALSE, value.data());
}
void Shader::set_array(const char* name, const float* values, int count) const {
  if (count > 0) glUniform4fv(glGetUniformLocation(program_, name), count, values);
}
void Shader::set_array(const char* name, std::span<const Vec3f> values) const {
  static_assert(sizeof(Vec3f) == 3 * sizeof(float));
  glUniform3fv(glGetUniformLocation(program_, name), static_cast<GLsizei>(values.size()),
               &values.front().x);
}

}  // namespace trocar::render
