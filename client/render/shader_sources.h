#pragma once

// GLSL of the scene. Light is computed in linear colour and encoded at the end of each fragment
// shader, so that the picture is the same in a window and in memory.

namespace trocar::render {

// The organ's fragment shader is made twice: for the outside, and with INSIDE for what a blade has
// laid open. FINE adds looks into the relief, NEAR those that are seen from near alone.
//
// Two lamps that move with the camera (a key light from above right, a cool one from the left), and
// soft light from above. Prefixed to both lit shaders, after one of the two heads. Powers are
// written as products: on a software rasteriser they are most of the picture's time.
inline constexpr const char* kFineHead = "#version 330 core\n#define FINE 1\n#define PICTURE 1\n";
inline constexpr const char* kPlainHead = "#version 330 core\n#define PICTURE 1\n";
inline constexpr const char* kNearHead = "#define NEAR 1\n";
inline constexpr const char* kInsideHead = "#define INSIDE 1\n";
inline constexpr const char* kLightingSource = R"(uniform vec3 eye;
uniform vec3 key_direction;
uniform vec3 fill_direction;
uniform float lamp;  // m: the key light is at the eye and falls to half over so much; 0: far away
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
// Returns the key light at a place so far from the eye.
float key_light(float apart) {
  return lamp > 0.0 ? 1.7 * lamp * lamp / (lamp * lamp + apart * apart) : 1.0;
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
// w: outside 0, and -1 on the rim of a wound; inside 1 at the rim, 2 where the wound is deep; and
// four times the number of the part.
layout(location = 3) in vec4 rest;
// The normal of a rim, elsewhere as the other one; w: the cube root of how deep blood stands, in
// parts of 5.1 mm.
layout(location = 4) in vec4 lip;
layout(location = 5) in vec2 texture_place;
uniform mat4 clip_from_world;
uniform vec3 part_dark[4], part_light[4];  // colours of the parts: in the troughs, on the heights
out vec3 world_position, world_normal, rest_position, lip_normal;
out float rim, blood_mm;
out vec2 picture_place;
out vec4 tint;
flat out vec3 dark, light;
void main() {
  world_position = position;
  world_normal = normal;
  rest_position = rest.xyz;
  float part = floor((rest.w + 1.0) * 0.25);
  rim = rest.w - 4.0 * part;
  dark = part_dark[int(part)];
  light = part_light[int(part)];
  lip_normal = lip.xyz;
  float root = max(lip.w, 0.0);
  blood_mm = 5.1 * root * root * root;
  tint = overlay;
  picture_place = texture_place;
  gl_Position = clip_from_world * vec4(position, 1.0);
}
)";

// The backs of triangles: dark, wet tissue that no lamp reaches.
inline constexpr const char* kBackFragmentSource = R"(
in vec3 world_position, world_normal;
out vec4 colour;
void main() {
  float facing = abs(dot(normalize(world_normal), normalize(eye - world_position)));
  colour = encode(vec3(0.0130, 0.0013, 0.0011) * (0.35 + 0.65 * facing));
}
)";

inline constexpr const char* kOrganFragmentSource = R"(
in vec3 world_position, world_normal, rest_position, lip_normal;
in float rim, blood_mm;
in vec2 picture_place;
in vec4 tint;
flat in vec3 dark, light;
out vec4 colour;
uniform sampler3D noise;       // rgb: slope of the relief, a: its height; inside it has lobules
#ifdef PICTURE
uniform sampler2D picture;     // of the outside
uniform int has_picture;
#endif
uniform vec4 lines;            // colour of vessels and fibres, a: how much of it
uniform vec4 figures;          // pattern, gloss, relief and translucency, in shares of a liver's; inside
                               // the last one says how far lobules are seen
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

// Turned against the other patterns, so that no tile of them is seen again beside itself.
const mat3 kTurn = 143.0 * mat3(0.36, 0.48, -0.80, -0.80, 0.60, 0.0, 0.48, 0.64, 0.60);
#ifdef INSIDE
const vec2 kScales = vec2(13.0, 83.0);  // tiles per metre: mouths of vessels, lobules
const float kRelief = 0.30, kFillShine = 0.15;
#else
const vec2 kScales = vec2(11.0, 58.0);
const float kRelief = 0.10, kFillShine = 1.0;
const float kThin = 0.160;  // mm: a thinner film stands in patches of this depth
#endif

void main() {
  vec3 to_eye = eye - world_position;
  float apart = length(to_eye);
  vec3 view = to_eye / apart;
#ifdef INSIDE
  float depth = rim - 1.0;
  // How much of a lip this is: all of it at the rim, nothing a millimetre away.
  float lip = 1.0 - min(depth * 18.0, 1.0), beside = 1.0 - min(depth * 6.0, 1.0);
#else
  float seam = -rim;
  float lip = max(seam * 3.5 - 2.5, 0.0), beside = min(seam * 1.5, 1.0);
#endif
  vec3 place = rest_position * figures.x;
#ifdef FINE
  vec4 coarse = texture(noise, place * kScales.x);
  vec4 fine = texture(noise, place * kScales.y + 0.37);
#elif defined(INSIDE)
  vec4 fine = texture(noise, place * kScales.y + 0.37);
  vec4 coarse = vec4(0.5, 0.5, 0.5, 0.4);
#else
  vec4 coarse = texture(noise, place * 24.0);
  vec4 fine = mix(vec4(0.5), coarse, 0.3);
#endif
  float near = 0.0;
#ifdef NEAR
  // This is too small to be seen from afar.
  near = clamp(1.5 - apart * 7.0, 0.0, 1.0);
  vec4 grain = mix(vec4(0.5), texture(noise, kTurn * place), near);
#else
  vec4 grain = vec4(0.5);
#endif
  vec3 n = normalize(mix(world_normal, lip_normal, lip * lip * (2.7 - 1.8 * lip)));
  // A normal between two walls may lean away from this triangle: it is leant back.
  vec3 along = dFdx(world_position), across = dFdy(world_position);
  vec3 face = cross(along, across);
  face *= inversesqrt(max(dot(face, face), 1e-30)) * sign(dot(face, view));
  n = normalize(n + face * max(0.2 - dot(n, face), 0.0));

#ifdef INSIDE
  // Cut tissue soaks it up.
  float film = blood_mm * (0.5 + coarse.a);
#else
  // A thin film does not cover all: it stands in patches, and its mean is what there is.
  float spread = min(blood_mm / kThin, 1.0);
  float ground = 0.5 + (coarse.a - 0.5) * 0.9 + (fine.a - 0.5) * 0.5 + (grain.a - 0.5) * 0.35;
  float edge = (1.0 - spread) * 1.24 - 0.12;
  float patches = smoothstep(edge - 0.12, edge + 0.12, ground);
  float film = blood_mm / max(spread, 0.02) * patches * (0.15 + 1.7 * coarse.a);
#endif
  float cover = 1.0 - exp2(-45.0 * film);
  float deep = 1.0 - exp2(-3.2 * film);

  // Relief that is smaller than a pixel would only glitter; a film fills it.
  float relief = kRelief * figures.z * min(1.0, 0.35 / apart) * (1.0 - 0.6 * cover);
  vec3 slope = coarse.rgb + fine.rgb - 1.0 + (grain.rgb - 0.5) * 1.2;
  // Blood that runs down is not level.
  n = normalize(n + relief * slope + 0.30 * cover * (coarse.rgb - 0.5));
#if defined(FINE) && !defined(INSIDE)
  // The film's border is round, and shines.
  vec2 rise = vec2(dFdx(film), dFdy(film)) * 0.0004;
  vec3 lean = rise.x * along / max(dot(along, along), 1e-12) + rise.y * across / max(dot(across, across), 1e-12);
  n = normalize(n - lean * min(1.0, 0.5 * inversesqrt(max(dot(lean, lean), 1e-6))));
#endif
  float facing = max(dot(n, view), 0.0);

  vec3 albedo;
  float wet;
#ifdef INSIDE
  // Cut tissue: lobules of about a millimetre with finer grain, here and there the mouth of a
  // vessel with a pale wall. The deeper, the darker.
  float lobule = mix(0.5, fine.a, figures.w);
  albedo = mix(dark, light, clamp(0.25 + 0.55 * lobule + 0.9 * (grain.a - 0.5), 0.0, 1.0));
  albedo = mix(albedo, lines.rgb, lines.a * (1.0 - smoothstep(0.05, 0.30, fine.a)));
  float mouth = smoothstep(0.80, 0.86, coarse.a), wall = smoothstep(0.70, 0.76, coarse.a) - mouth;
  albedo = mix(albedo, lines.rgb * 1.5, 0.75 * wall * figures.w);
  albedo *= 1.0 - 0.92 * mouth * figures.w;
  albedo *= 1.0 - 0.70 * depth * (2.0 - depth);
  wet = 0.50 + 0.35 * fine.a;
#else
  // Broad clouds with a fine grain under the capsule, and vessels where the clouds meet.
  float mottle = clamp(0.70 * coarse.a + 0.30 * fine.a + 0.75 * (grain.a - 0.5), 0.0, 1.0);
  albedo = mix(dark, light, mottle) * (0.93 + 0.14 * fine.a);
  float vein = (1.0 - min(abs(2.0 * coarse.a - 1.0) * 7.0, 1.0)) * smoothstep(0.36, 0.60, fine.a);
  albedo = mix(albedo, lines.rgb, lines.a * vein);
#ifdef PICTURE
  if (has_picture != 0) {
    // Painted as it is to be seen: darkened to how tissue answers these lamps.
    vec3 painted = texture(picture, picture_place).rgb;
    albedo = painted * painted * (0.30 + 0.04 * fine.a);
  }
#endif
  // At a wound's lip the capsule ends, and a thin line of blood seeps out.
  float ends = seam * seam;
  ends *= ends;
  albedo = mix(albedo, vec3(0.040, 0.0022, 0.0020), ends * ends * (0.45 + 0.35 * coarse.a));
  wet = 0.75 + 0.5 * coarse.a;
#endif
  wet *= figures.y;

  // Light passes the film twice: what is below it loses green and blue first, and where the film is
  // deep it is nearly black.
  vec3 through = exp2(vec3(-3.2, -45.0, -52.0) * film);
  vec3 body = mix(vec3(0.135, 0.0046, 0.0036), vec3(0.026, 0.0006, 0.0006), deep);
  albedo = albedo * through + body * (1.0 - through.g);
  wet = mix(wet, 1.25, cover);

  float shade = tool_shadow(world_position);
  float reach = key_light(apart);
  vec3 to_key = lamp > 0.0 ? normalize(view + 0.12 * key_direction) : key_direction;
#ifdef INSIDE
  // Little light comes down into a wound.
  float open = 1.0 - 0.66 * depth * (2.0 - depth);
#else
  const float open = 1.0;
#endif
  // Light wraps around the edge of the shadow, red farthest: it has been under the surface.
  vec3 wrap = vec3(0.38, 0.14, 0.10);
  vec3 key = clamp((vec3(dot(n, to_key)) + wrap) / (1.0 + wrap), 0.0, 1.0) * (shade * open);
  float others = lamp > 0.0 ? 0.25 : 1.0;
  vec3 fill = clamp((vec3(dot(n, fill_direction)) + wrap) / (1.0 + wrap), 0.0, 1.0) * (open * others);
  vec3 sky = hemisphere(n) * ((0.6 + 0.4 * shade) * open * others);
  vec3 lit = albedo * (key_colour * reach * key * key + fill_colour * fill + sky);
#ifndef INSIDE
  // At the rim it is thin.
  lit += light * (0.38 * figures.w * (1.0 - facing) * (1.0 - facing) * shade * reach * others * (1.0 - cover));
#endif

  float fresnel = 0.035 + 0.965 * power5(1.0 - facing);
  vec2 key_film = highlights(n, view, to_key), fill_film = highlights(n, view, fill_direction);
#ifdef INSIDE
  // The film is broken by the grain: it shines broadly. What it mirrors is tissue, not the sky.
  vec2 share = mix(vec2(0.010, 0.05), vec2(0.010, 0.13), cover);
  fresnel = min(fresnel, 0.20);
  vec3 mirrored = vec3(0.050, 0.011, 0.010) * mix(0.5, 1.0, cover);
#else
  vec2 share = mix(vec2(0.038, 0.62), vec2(0.034, 0.85), cover);
  // Blood is a mirror of the room, which is bright above.
  float above = smoothstep(-0.75, 0.70, reflect(-view, n).y);
  vec3 mirrored = hemisphere(reflect(-view, n)) * 0.55;
  mirrored = mix(mirrored, vec3(1.50, 1.45, 1.40) * above * above, 0.8 * cover);
#endif
  vec3 shine = key_colour * (reach * shade * open * (share.y * key_film.y + share.x * key_film.x));
  shine += fill_colour * ((0.26 * fill_film.y + 0.06 * fill_film.x) * open * others * kFillShine);
  shine += mirrored * (fresnel * (0.5 + 0.5 * shade) * open * others);
  // A lip is an edge: it has no face to shine with, or all of it would be one white line.
  lit += shine * (wet * (1.0 - 0.88 * beside));

  // The overlay glows through: tissue darkens and takes the region's colour, the film stays.
  lit = mix(lit, lit * 0.35 + tint.rgb * (0.035 + 0.11 * key.g + 0.07 * fill.g), tint.a);
  lit += tint.rgb * 0.13 * smoothstep(0.55, 0.9, tint.a);  // what is held firmly shines by itself
  // Haze lies over what is farther away.
  float far = clamp((apart - haze.x) * haze.y, 0.0, 0.6);
  colour = encode(mix(lit, vec3(0.020, 0.030, 0.036), far));
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
  vec3 diffuse = key_colour * (max(dot(n, key_direction), 0.0) * key_light(length(eye - world_position))) + fill_colour * max(dot(n, fill_direction), 0.0)
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
