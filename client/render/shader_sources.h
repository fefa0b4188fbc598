#pragma once

// GLSL of the scene. Light is computed in linear colour and encoded at the end of each fragment
// shader, so that the picture is the same in a window and in memory.

namespace trocar::render {

// Two lamps that move with the camera (a key light from above right, a cool one from the left), and
// soft light from above. Prefixed to both lit shaders, after one of the two heads. Powers are
// written as products: on a software rasteriser they are most of the picture's time.
inline constexpr const char* kFineHead = "#version 330 core\n#define FINE 1\n#define PICTURE 1\n";
inline constexpr const char* kPlainHead = "#version 330 core\n#define PICTURE 1\n";
inline constexpr const char* kLightingSource = R"(uniform vec3 eye;
uniform vec3 key_direction;
uniform vec3 fill_direction;
const vec3 key_colour = vec3(2.55, 2.42, 2.25);
const vec3 fill_colour = vec3(0.42, 0.52, 0.68);
const vec3 sky_colour = vec3(0.34, 0.40, 0.48);
const vec3 ground_colour = vec3(0.10, 0.075, 0.075);

vec3 hemisphere(vec3 n) { return mix(ground_colour, sky_colour, 0.5 + 0.5 * n.y); }
// Blinn's highlight to the powers 32 and 256.
vec2 highlights(vec3 n, vec3 view, vec3 light) {
  float h = max(dot(n, normalize(view + light)), 0.0);
  h *= h; h *= h; h *= h; h *= h; h *= h;
  float sharp = h * h;
  sharp *= sharp;
  return vec2(h, sharp * sharp);
}
float power5(float x) { return x * x * x * x * x; }
// Filmic curve (after Narkowicz 2015), then the sRGB transfer function by square roots.
vec4 encode(vec3 c) {
  c = clamp(c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14), 0.0, 1.0);
  vec3 a = sqrt(c), b = sqrt(a), d = sqrt(b);
  return vec4(0.585122381 * a + 0.783140355 * b - 0.368262736 * d, 1.0);
}
)";

inline constexpr const char* kOrganVertexSource = R"(#version 330 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec4 overlay;
// w: outside 0, and -1 on the rim of a wound; inside 1 at the rim, 2 where the wound is deep.
layout(location = 3) in vec4 rest;
// The normal of a rim, elsewhere as the other one; w: how much of the surface blood covers.
layout(location = 4) in vec4 lip;
layout(location = 5) in vec2 texture_place;
uniform mat4 clip_from_world;
out vec3 world_position, world_normal, rest_position, lip_normal;
out float rim, covered;
out vec2 picture_place;
out vec4 tint;
void main() {
  world_position = position;
  world_normal = normal;
  rest_position = rest.xyz;
  rim = rest.w;
  lip_normal = lip.xyz;
  covered = max(lip.w, 0.0);
  tint = overlay;
  picture_place = texture_place;
  gl_Position = clip_from_world * vec4(position, 1.0);
}
)";

inline constexpr const char* kOrganFragmentSource = R"(
in vec3 world_position, world_normal, rest_position, lip_normal;
in float rim, covered;
in vec2 picture_place;
in vec4 tint;
out vec4 colour;
uniform sampler3D noise;       // rgb: slope of the relief, a: its height
#ifdef PICTURE
uniform sampler2D picture;     // of the outside
uniform int has_picture;
#endif
uniform vec2 haze;             // from this distance on (m), so much per metre; 0: none
uniform int shadow_count;
uniform vec4 shadow_tip[8];    // xyz tip, w radius
uniform vec4 shadow_shaft[8];  // xyz direction, w length

// Light that a tool takes away at p: the key lamp's shadow, and a soft one where it touches.
float tool_shadow(vec3 p) {
  float light = 1.0;
  for (int i = 0; i < shadow_count; ++i) {
    vec3 a = shadow_shaft[i].xyz;
    vec3 w = p - shadow_tip[i].xyz;
    float radius = shadow_tip[i].w;
    // Closest approach of the ray p + s key and the shaft tip + t a.
    float along = dot(key_direction, a);
    float wl = dot(w, key_direction), wa = dot(w, a);
    float t = clamp((wa - along * wl) / max(1.0 - along * along, 0.02), 0.0, shadow_shaft[i].w);
    float s = max(t * along - wl, 0.0);
    vec3 gap = w + key_direction * s - a * t;
    float far = 1.0 / (1.0 + 5.0 * s);
    float inside = clamp(1.25 - dot(gap, gap) / (radius * radius * (1.6 + 90.0 * s)), 0.0, 1.0);
    light *= 1.0 - 0.66 * far * inside * inside;
    vec3 off = w - a * clamp(wa, 0.0, shadow_shaft[i].w);
    float touch = clamp(1.0 - dot(off, off) / (7.0 * radius * radius), 0.0, 1.0);
    light *= 1.0 - 0.42 * touch * touch;
  }
  return light;
}

void main() {
  vec3 to_eye = eye - world_position;
  float apart = length(to_eye);
  vec3 view = to_eye / apart;
  bool is_inside = rim > 0.5;
  float depth = is_inside ? rim - 1.0 : 0.0;
  float seam = is_inside ? 0.0 : -rim;
  // How much of a lip this is: all of it at the rim, nothing a millimetre away.
  float lip = is_inside ? 1.0 - min(depth * 18.0, 1.0) : max(seam * 3.5 - 2.5, 0.0);
#ifdef FINE
  vec4 coarse = texture(noise, rest_position * (is_inside ? 27.0 : 11.0));
  vec4 fine = texture(noise, rest_position * (is_inside ? 83.0 : 58.0) + 0.37);
#else
  vec4 coarse = texture(noise, rest_position * (is_inside ? 47.0 : 24.0));
  vec4 fine = mix(vec4(0.5), coarse, is_inside ? 0.7 : 0.3);
#endif
  vec3 n = normalize(mix(world_normal, lip_normal, lip * lip * (2.7 - 1.8 * lip)));
  // A normal between two walls may lean away from this triangle: it is leant back.
  vec3 face = cross(dFdx(world_position), dFdy(world_position));
  face *= inversesqrt(max(dot(face, face), 1e-30)) * sign(dot(face, view));
  n = normalize(n + face * max(0.2 - dot(n, face), 0.0));
  // Blood has an edge, which the grain below it draws.
  float blood = smoothstep(0.08, 0.50, covered * (0.35 + 0.9 * coarse.a + 0.4 * fine.a));
  // Relief that is smaller than a pixel would only glitter.
  float relief = (is_inside ? 0.16 : 0.10) * min(1.0, 0.35 / apart) * (1.0 - 0.55 * blood);
  n = normalize(n + relief * (coarse.rgb + fine.rgb - 1.0));
  float facing = max(dot(n, view), 0.0);

  vec3 albedo;
  float wet;
  if (is_inside) {
    // Parenchyma: brown-red lobules of about a millimetre, and paler lines between them. The
    // deeper, the more blood stands on it.
    float line = 1.0 - min(abs(2.0 * fine.a - 1.0) * 3.2, 1.0);
    float grain = 0.65 * fine.a + 0.35 * coarse.a;
    albedo = mix(vec3(0.055, 0.0062, 0.0050), vec3(0.150, 0.0260, 0.0190), grain);
    albedo = mix(albedo, vec3(0.205, 0.062, 0.046), 0.42 * line * line);
    albedo = mix(albedo, vec3(0.030, 0.0016, 0.0016), 0.75 * depth * (2.0 - depth));
    wet = 0.45 + 0.35 * coarse.a;
  } else {
    // Red-brown parenchyma, broad clouds with a fine grain under the capsule.
    float mottle = clamp(0.70 * coarse.a + 0.30 * fine.a, 0.0, 1.0);
    albedo = mix(vec3(0.068, 0.0115, 0.0090), vec3(0.138, 0.0245, 0.0165), mottle);
    albedo *= 0.93 + 0.14 * fine.a;
#ifdef PICTURE
    if (has_picture != 0) {
      // Painted as it is to be seen: darkened to how tissue answers these lamps.
      vec3 painted = texture(picture, picture_place).rgb;
      albedo = painted * painted * (0.30 + 0.04 * fine.a);
    }
#endif
    // At a wound's lip the capsule ends, and a thin line of blood seeps out.
    float edge = seam * seam;
    edge *= edge;
    albedo = mix(albedo, vec3(0.040, 0.0022, 0.0020), edge * edge * (0.45 + 0.35 * coarse.a));
    wet = 0.75 + 0.5 * coarse.a;
  }

  // A film of blood hides what it covers; where it is deep it is nearly black.
  float deep = covered * covered;
  albedo = mix(albedo, mix(vec3(0.190, 0.0060, 0.0050), vec3(0.090, 0.0016, 0.0015), deep), blood);
  wet = mix(wet, 1.2, blood);

  float shade = tool_shadow(world_position);
  // Little light comes down into a wound.
  float open = 1.0 - 0.72 * depth * (2.0 - depth);
  // Light wraps around the edge of the shadow, red farthest: it has been under the surface.
  vec3 wrap = vec3(0.38, 0.14, 0.10);
  vec3 key = clamp((vec3(dot(n, key_direction)) + wrap) / (1.0 + wrap), 0.0, 1.0) * shade * open;
  vec3 fill = clamp((vec3(dot(n, fill_direction)) + wrap) / (1.0 + wrap), 0.0, 1.0) * open;
  vec3 sky = hemisphere(n) * ((0.6 + 0.4 * shade) * open);
  vec3 lit = albedo * (key_colour * key * key + fill_colour * fill + sky);
  if (!is_inside) lit += vec3(0.050, 0.007, 0.005) * (1.0 - facing) * (1.0 - facing) * shade;  // thin at the rim

  float fresnel = 0.035 + 0.965 * power5(1.0 - facing);
  vec2 key_film = highlights(n, view, key_direction), fill_film = highlights(n, view, fill_direction);
  // Inside, the film is broken by the grain: it shines broadly, without a sharp glint.
  vec2 share = is_inside ? vec2(0.034, 0.05) : vec2(0.038, 0.62);
  // The walls of a wound are facets, which a sharp glint would fill.
  share = mix(share, vec2(0.028, is_inside ? 0.12 : 0.60), blood);
  vec3 film = key_colour * (shade * open * (share.y * key_film.y + share.x * key_film.x) * wet);
  film *= 1.0 - 0.8 * lip * (1.0 - blood);
  film += fill_colour * ((0.26 * fill_film.y + 0.06 * fill_film.x) * wet * open);
  float mirror = mix(is_inside ? 0.22 : 0.55, is_inside ? 0.4 : 0.9, blood);
  film += hemisphere(reflect(-view, n)) * (fresnel * mirror * (0.5 + 0.5 * shade) * open);

  // The overlay glows through: tissue darkens and takes the region's colour, the film stays.
  lit = mix(lit, lit * 0.35 + tint.rgb * (0.035 + 0.11 * key.g + 0.07 * fill.g), tint.a);
  lit += tint.rgb * 0.13 * smoothstep(0.55, 0.9, tint.a);  // what is held firmly shines by itself
  // Haze lies over what is farther away.
  float far = clamp((apart - haze.x) * haze.y, 0.0, 0.6);
  colour = encode(mix(lit + film, vec3(0.020, 0.030, 0.036), far));
}
)";

inline constexpr const char* kToolVertexSource = R"(#version 330 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec4 material;  // rgb colour, a: 0 plastic to 1 steel
uniform mat4 clip_from_world;
uniform mat4 world_from_model;
out vec3 world_position, world_normal;
out vec4 surface;
void main() {
  vec4 p = world_from_model * vec4(position, 1.0);
  world_position = p.xyz;
  world_normal = mat3(world_from_model) * normal;
  surface = material;
  gl_Position = clip_from_world * p;
}
)";

inline constexpr const char* kToolFragmentSource = R"(
in vec3 world_position, world_normal;
in vec4 surface;
out vec4 colour;
uniform float glow;  // 0 lit, 1 its own colour
uniform float dim;   // 1 as it is; less for a tool that has fallen silent
void main() {
  vec3 n = normalize(world_normal);
  vec3 view = normalize(eye - world_position);
  vec3 base = surface.rgb * surface.rgb * dim;
  float steel = surface.a;
  float fresnel = power5(1.0 - max(dot(n, view), 0.0));
  vec3 diffuse = key_colour * max(dot(n, key_direction), 0.0) + fill_colour * max(dot(n, fill_direction), 0.0)
      + hemisphere(n);
  vec3 r = reflect(-view, n);
  // A theatre reflected in steel: dark below, a bright lamp band above.
  float band = smoothstep(-0.15, 0.25, r.y) * (0.35 + 0.65 * smoothstep(0.25, 0.8, r.y));
  vec3 mirror = mix(vec3(0.05, 0.06, 0.075), vec3(0.95, 1.0, 1.05), band);
  vec3 lit = base * diffuse * mix(0.75, 0.22, steel) + mirror * mix(vec3(0.05), base * 0.9, steel)
      + mirror * fresnel * 0.5;
  vec2 shine = highlights(n, view, key_direction);
  lit += key_colour * mix(0.22 * shine.x, 0.30 * shine.x + 0.6 * shine.y, steel);
  colour = encode(mix(lit, base * 1.35, glow));
}
)";

}  // namespace trocar::render
