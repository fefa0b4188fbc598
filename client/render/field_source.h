#pragma once

// GLSL of the operating field behind the organ: a cloth under it, lit by the lamp, that fades into
// the dark. It hides nothing and depends on the view alone, so that it is drawn once for each view.

namespace trocar::render {

inline constexpr const char* kFieldVertexSource = R"(#version 330 core
uniform vec3 forward, right, up;  // right and up as long as half the picture at one metre
out vec3 ray;
void main() {
  vec2 at = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2) * 2.0 - 1.0;
  ray = forward + right * at.x + up * at.y;
  gl_Position = vec4(at, 1.0, 1.0);
}
)";

// After the head and the lighting, as the lit shaders.
inline constexpr const char* kFieldFragmentSource = R"(
in vec3 ray;
out vec4 colour;
uniform vec3 organ_centre;  // y: where the cloth lies
uniform vec3 organ_size;    // m, half of it along x and z; y: how high it is above the cloth

// Slow folds that run across the cloth: its slope along x and z.
vec2 folds(vec2 p) {
  float a = dot(p, vec2(9.0, 4.0)), b = dot(p, vec2(-5.0, 11.0)), c = dot(p, vec2(21.0, -8.0));
  return 0.085 * cos(a + 1.7 * sin(b * 0.5)) * vec2(0.91, 0.41) + 0.055 * cos(b + sin(a)) * vec2(-0.41, 0.91)
      + 0.03 * cos(c + 2.0 * sin(b)) * vec2(0.93, -0.36);
}

void main() {
  vec3 dark = vec3(0.0050, 0.0085, 0.0105);
  float down = organ_centre.y - eye.y;
  float t = down / min(ray.y, -1e-4);
  vec3 lit = dark;
  if (ray.y < 0.0 && t > 0.0 && t < 6.0) {
    vec3 p = eye + ray * t - organ_centre;
    float size = max(organ_size.x, organ_size.z);
    float off = length(p.xz) / size;
    vec2 slope = folds(p.xz) * smoothstep(0.6, 1.6, off);
    vec3 n = normalize(vec3(slope.x, 1.0, slope.y));
    // Threads of three millimetres, as far as pixels tell them apart.
    vec2 thread = sin(p.xz * 2094.4);
    vec2 width = fwidth(p.xz);
    float weave = thread.x * thread.y * clamp(1.0 - max(width.x, width.y) / 0.0009, 0.0, 1.0);
    vec3 cloth = vec3(0.020, 0.082, 0.088) * (1.0 + 0.10 * weave + 0.9 * (slope.x + slope.y));
    lit = cloth * (key_colour * max(dot(n, key_direction), 0.0) + 0.6 * hemisphere(n)) * key_light(t);
    // The lamp's pool, and the organ's own soft shadow on the cloth.
    float pool = exp(-0.13 * off * off);
    vec2 under = p.xz / (organ_size.xz + 0.55 * organ_size.y);
    float shadow = exp(-2.2 * max(dot(under, under) - 0.25, 0.0));
    lit *= (0.16 + 0.84 * pool) * (1.0 - 0.86 * shadow);
    lit = mix(lit, dark, smoothstep(1.8, 6.0, off));
  }
  // One step of dither, so that the slow gradient shows no bands.
  float grain = fract(sin(dot(gl_FragCoord.xy, vec2(12.9898, 78.233))) * 43758.5453) - 0.5;
  colour = encode(lit) + vec4(vec3(grain / 255.0), 0.0);
}
)";

// An endoscope's picture is a disc, darker towards its edge. It lies over what was drawn.
inline constexpr const char* kScopeMaskSource = R"(#version 330 core
in vec3 ray;  // x and y: from -1 to 1 across the picture
out vec4 colour;
uniform float aspect;
void main() {
  float r = length(ray.xy * vec2(aspect, 1.0));
  float edge = fwidth(r) * 1.5;
  float dark = 0.38 * smoothstep(0.45, 1.0, r);
  colour = vec4(0.0, 0.0, 0.0, max(dark, smoothstep(0.97 - edge, 0.97 + edge, r)));
}
)";

}  // namespace trocar::render
