#include "server/organs/formats/glb_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>
#include <vector>

#include "common/base/json.h"
#include "server/organs/formats/glb_numbers.h"
#include "server/organs/formats/part_names.h"
#include "server/organs/formats/text_reader.h"
#include "server/organs/formats/weld.h"

namespace trocar::formats {
namespace {

constexpr std::size_t kHeader = 12, kChunkHeader = 8;
constexpr std::size_t kMostJsonBytes = 4 * 1024 * 1024;
constexpr std::size_t kMostNodes = 10'000, kMostPrimitives = 100'000;  // the latter of all nodes
// Both are of what is built: a value of JSON, and a triangle with its places in a picture.
constexpr std::size_t kBytesPerValue = 200, kBytesPerTriangle = 200;
constexpr std::size_t kMostGrowth = 16, kSmallBytes = 16 * 1024 * 1024;
constexpr std::uint32_t kJsonChunk = 0x4e4f534a, kBinaryChunk = 0x004e4942;
constexpr int kTriangles = 4;

// An object of this kind finds its keys by their order: one that keeps them as they come compares
// each with all before it, and a file of 4 MiB would take minutes.
using Json = nlohmann::json;

// It says what is wrong, and leaves this file as an Error.
struct GlbFault {
  std::string what;
};

[[noreturn]] void fail(std::string what) {
  throw GlbFault{std::move(what)};
}

// Columns of a 3 x 3 matrix, and the place of the origin.
struct Motion {
  std::array<Vec3d, 3> columns{Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}};
  Vec3d origin;

  Vec3d turned(const Vec3d& v) const {
    return columns[0] * v.x + columns[1] * v.y + columns[2] * v.z;
  }
  Vec3d operator*(const Vec3d& p) const { return turned(p) + origin; }
  Motion operator*(const Motion& o) const {
    return {{turned(o.columns[0]), turned(o.columns[1]), turned(o.columns[2])}, *this * o.origin};
  }
  bool is_mirrored() const { return dot(cross(columns[0], columns[1]), columns[2]) < 0; }
};

// Numbers of a buffer, `count` rows of them.
struct Rows {
  std::string_view bytes;
  std::size_t stride = 0, count = 0;
  int component = kFloat;

  template <typename T>
  T at(std::size_t row, std::size_t column) const {
    T value;
    std::memcpy(&value, bytes.data() + row * stride + column * sizeof(T), sizeof value);
    return value;
  }
  std::uint32_t index(std::size_t row) const {
    if (component == kUInt8) return at<std::uint8_t>(row, 0);
    return component == kUInt16 ? at<std::uint16_t>(row, 0) : at<std::uint32_t>(row, 0);
  }
  // Whole numbers stand for shares of the largest one.
  double share(std::size_t row, std::size_t column) const {
    if (component == kFloat) return double{at<float>(row, column)};
    return component == kUInt8 ? at<std::uint8_t>(row, column) / 255.0
                               : at<std::uint16_t>(row, column) / 65535.0;
  }
};

std::size_t component_bytes(int component) {
  return component == kUInt8 ? 1 : component == kUInt16 ? 2 : 4;
}

class GlbReader {
 public:
  explicit GlbReader(std::string_view file) : file_(file) {}

  surface::RawSurface read() {
    open();
    walk();
    auto surface = weld(corners_);
    surface.unit_m = 1;
    surface.axes = surface::Axes::LeftHeadFront;  // y up, z forward (3.4)
    if (corners_.empty()) fail("has no triangles");
    if (skipped_ > 0)
      surface.left_out.push_back("left out " + std::to_string(skipped_) +
                                 " lists of points or lines");
    if (const Json* moved = member(json_, "animations"); moved != nullptr && !moved->empty())
      surface.left_out.push_back("left out its animations: taken in its pose at rest");
    if (const Json* scenes = member(json_, "scenes"); scenes->size() > 1)
      surface.left_out.push_back("left out the other " + std::to_string(scenes->size() - 1) +
                                 " scenes");
    parts_.say(surface.left_out);
    if (picture_) {
      surface.picture = std::string(view(*find(element("images", *picture_), "bufferView")));
      if (lacks_place_) fault_ = "some of its meshes have no texture coordinates";
    }
    if (fault_.empty() && !lacks_place_) surface.corner_texture = std::move(texture_);
    surface.texture_fault = std::move(fault_);
    return surface;
  }

 private:
  std::uint32_t word(std::size_t at) const {
    std::uint32_t value = 0;
    std::memcpy(&value, file_.data() + at, sizeof value);
    return value;
  }

  std::size_t most_built() const { return kMostGrowth * file_.size() + kSmallBytes; }

  void open() {
    if (file_.size() < kHeader + kChunkHeader || !file_.starts_with("glTF"))
      fail("is no glTF binary file");
    if (word(4) != 2) fail("is of glTF version " + std::to_string(word(4)) + ", 2 is read");
    if (word(8) != file_.size())
      fail("says that it has " + std::to_string(word(8)) + " bytes, it has " +
           std::to_string(file_.size()) + ": it is cut off, or has too much");
    std::string_view json;
    std::size_t at = kHeader;
    for (int chunk = 0; at < file_.size(); ++chunk) {
      if (file_.size() - at < kChunkHeader) fail("ends within the header of a chunk");
      const std::size_t bytes = word(at), kind = word(at + 4);
      at += kChunkHeader;
      if (bytes > file_.size() - at) fail("chunk " + std::to_string(chunk) + " is cut off");
      if (chunk == 0 && kind != kJsonChunk) fail("does not begin with a JSON chunk");
      if (chunk == 0) json = file_.substr(at, bytes);
      if (chunk == 1 && kind == kBinaryChunk) binary_ = file_.substr(at, bytes);
      at += bytes;
    }
    if (json.size() > kMostJsonBytes) fail("its JSON has more than 4 MiB");
    const auto values = static_cast<std::size_t>(
        std::ranges::count_if(json, [](char c) { return c == ',' || c == '[' || c == '{'; }));
    if (values * kBytesPerValue > most_built())
      fail("its JSON of some " + std::to_string(values) + " values is far more than the file's");
    json_ = Json::parse(json, nullptr, false);
    if (!json_.is_object()) fail("its JSON is malformed");
    if (const Json* needed = member(json_, "extensionsRequired"); needed && !needed->empty())
      fail("needs the extension " +
           (needed->is_array() && needed->front().is_string()
                ? shown(needed->front().get_ref<const std::string&>())
                : std::string("that it names wrongly")) +
           ", which is not read: save it without");
  }

  // ---- JSON that is checked as it is read ----

  // Null: there is none.
  static const Json* member(const Json& object, const char* key) {
    if (!object.is_object()) return nullptr;
    const auto found = object.find(key);
    return found == object.end() ? nullptr : &*found;
  }
  static std::optional<std::size_t> find(const Json& object, const char* key) {
    if (member(object, key) == nullptr) return std::nullopt;
    try {
      return whole_number<std::uint32_t>(object, key);
    } catch (const std::out_of_range& wrong) {
      fail(wrong.what());
    }
  }
  static std::size_t need(const Json& object, const char* key, const std::string& of) {
    const auto number = find(object, key);
    if (!number) fail(of + " has no " + key);
    return *number;
  }
  const Json& element(const char* array, std::size_t i) const {
    const Json* all = member(json_, array);
    if (all == nullptr || !all->is_array() || i >= all->size() || !(*all)[i].is_object())
      fail(std::string(array) + "[" + std::to_string(i) + "] is not there");
    return (*all)[i];
  }
  // Fills `numbers`, as many as the file must give. False: there are none.
  template <std::size_t n>
  static bool read_numbers(const Json& object, const char* key, const std::string& of,
                           std::array<double, n>& numbers) {
    const Json* list = member(object, key);
    if (list == nullptr) return false;
    if (!list->is_array() || list->size() != n)
      fail(of + ": " + key + " has not " + std::to_string(n) + " numbers");
    for (std::size_t i = 0; i < n; ++i) {
      if (!(*list)[i].is_number() || !std::isfinite((*list)[i].template get<double>()))
        fail(of + ": " + key + " holds what is no finite number");
      numbers[i] = (*list)[i].template get<double>();
    }
    return true;
  }

  // ---- buffers ----

  std::string_view view(std::size_t number) const {
    const Json& json = element("bufferViews", number);
    const std::string name = "bufferViews[" + std::to_string(number) + "]";
    const std::size_t buffer = need(json, "buffer", name);
    if (buffer != 0 || member(element("buffers", buffer), "uri") != nullptr)
      fail(name + " is in another file: save all in one");
    const std::size_t offset = find(json, "byteOffset").value_or(0);
    const std::size_t bytes = need(json, "byteLength", name);
    if (offset > binary_.size() || bytes > binary_.size() - offset)
      fail(name + " goes beyond the " + std::to_string(binary_.size()) + " bytes of the file");
    return binary_.substr(offset, bytes);
  }

  Rows rows(std::size_t number, std::string_view type, std::size_t columns) const {
    const Json& json = element("accessors", number);
    const std::string name = "accessors[" + std::to_string(number) + "]";
    if (member(json, "sparse") != nullptr) fail(name + " is sparse, which is not read");
    const Json* its_type = member(json, "type");
    if (its_type == nullptr || *its_type != type)
      fail(name + " is not of type " + std::string(type));
    const std::size_t view_number = need(json, "bufferView", name);
    Rows rows;
    rows.count = need(json, "count", name);
    rows.component = static_cast<int>(need(json, "componentType", name));
    if (rows.component != kUInt8 && rows.component != kUInt16 && rows.component != kUInt32 &&
        rows.component != kFloat)
      fail(name + " has componentType " + std::to_string(rows.component) + ", which is not read");
    const std::size_t width = columns * component_bytes(rows.component);
    const auto stride = find(element("bufferViews", view_number), "byteStride");
    rows.stride = stride.value_or(width);
    if (rows.stride < width || rows.stride > 252 + width)
      fail(name + " has rows of " + std::to_string(width) + " bytes every " +
           std::to_string(rows.stride));
    const std::string_view bytes = view(view_number);
    const std::size_t offset = find(json, "byteOffset").value_or(0);
    const bool fits = rows.count > 0 && offset <= bytes.size() && width <= bytes.size() - offset &&
                      rows.count - 1 <= (bytes.size() - offset - width) / rows.stride;
    if (!fits) fail(name + " has " + std::to_string(rows.count) + " rows, its view holds fewer");
    rows.bytes = bytes.substr(offset);
    return rows;
  }

  // ---- the scene ----

  void walk() {
    const Json& scene = element("scenes", find(json_, "scene").value_or(0));
    std::vector<std::pair<std::size_t, Motion>> waiting;
    add_nodes(scene, "nodes", "scene", Motion{}, waiting);
    std::vector<bool> seen;
    std::size_t count = 0;
    while (!waiting.empty()) {
      const auto [number, above] = waiting.back();
      waiting.pop_back();
      const std::string name = "nodes[" + std::to_string(number) + "]";
      const Json& node = element("nodes", number);
      if (++count > kMostNodes) fail("has more than 10,000 nodes");
      if (number >= seen.size()) seen.resize(number + 1);
      if (seen[number]) fail(name + " is below two others, or below itself");
      seen[number] = true;
      if (member(node, "skin") != nullptr)
        fail(name + " has a skin: save it in the pose that is meant");
      const Motion motion = above * motion_of(node, name);
      if (const auto mesh = find(node, "mesh")) {
        check_weights(node, element("meshes", *mesh), name);
        note_name("nodes", node);
        note_name("meshes", element("meshes", *mesh));
        add_mesh(*mesh, motion);
      }
      add_nodes(node, "children", name, motion, waiting);
    }
  }

  void note_name(const char* kind, const Json& part) {
    if (const Json* name = member(part, "name"); name != nullptr && name->is_string())
      parts_.add(kind, name->get_ref<const std::string&>());
  }

  // Those of a node go before those of its mesh.
  static void check_weights(const Json& node, const Json& mesh, const std::string& name) {
    const Json* weights = member(node, "weights");
    if (weights == nullptr) weights = member(mesh, "weights");
    if (weights == nullptr || std::ranges::all_of(*weights, [](const Json& w) { return w == 0; }))
      return;
    fail(name + " has weights that change its shape: save it in the shape that is meant");
  }

  static void add_nodes(const Json& of, const char* key, const std::string& name,
                        const Motion& motion,
                        std::vector<std::pair<std::size_t, Motion>>& waiting) {
    const Json* list = member(of, key);
    if (list == nullptr) return;
    if (!list->is_array()) fail(name + ": " + key + " is no list of nodes");
    if (waiting.size() + list->size() > kMostNodes) fail("has more than 10,000 nodes");
    // From last to first, so that they are taken in the file's order.
    for (std::size_t i = list->size(); i-- > 0;) {
      const Json& number = (*list)[i];
      if (!number.is_number_unsigned()) fail(name + ": " + key + " holds what is no node's number");
      waiting.emplace_back(number.get<std::size_t>(), motion);
    }
  }

  static Motion motion_of(const Json& node, const std::string& name) {
    Motion motion;
    if (std::array<double, 16> m{}; read_numbers(node, "matrix", name, m)) {
      for (std::size_t c = 0; c < 3; ++c)
        motion.columns[c] = {m[4 * c], m[4 * c + 1], m[4 * c + 2]};
      motion.origin = {m[12], m[13], m[14]};
      return motion;
    }
    std::array<double, 3> place{}, scale{1, 1, 1};
    std::array<double, 4> q{0, 0, 0, 1};
    read_numbers(node, "translation", name, place);
    read_numbers(node, "scale", name, scale);
    read_numbers(node, "rotation", name, q);
    const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(std::abs(norm - 1) < 1e-2)) fail(name + ": rotation is not of length 1");
    const double x = q[0] / norm, y = q[1] / norm, z = q[2] / norm, w = q[3] / norm;
    motion.columns = {
        Vec3d{1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)} * scale[0],
        Vec3d{2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)} * scale[1],
        Vec3d{2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)} * scale[2]};
    motion.origin = {place[0], place[1], place[2]};
    return motion;
  }

  void add_mesh(std::size_t number, const Motion& motion) {
    const std::string name = "meshes[" + std::to_string(number) + "]";
    const Json* primitives = member(element("meshes", number), "primitives");
    if (primitives == nullptr || !primitives->is_array()) fail(name + " has no primitives");
    primitives_ += primitives->size();
    if (primitives_ > kMostPrimitives) fail("has more than 100,000 primitives in all of its nodes");
    for (std::size_t i = 0; i < primitives->size(); ++i) {
      const std::size_t mode = find((*primitives)[i], "mode").value_or(kTriangles);
      if (mode < kTriangles) {
        ++skipped_;
        continue;
      }
      const std::string its_name = name + ".primitives[" + std::to_string(i) + "]";
      if (mode > kTriangles) fail(its_name + " is a strip or fan: save it as triangles");
      add_triangles((*primitives)[i], its_name, motion);
    }
  }

  void add_triangles(const Json& primitive, const std::string& name, const Motion& motion) {
    const Json* attributes = member(primitive, "attributes");
    if (attributes == nullptr) fail(name + " has no attributes");
    const Rows places = rows(need(*attributes, "POSITION", name), "VEC3", 3);
    if (places.component != kFloat) fail(name + ": POSITION is not of floats");
    std::optional<Rows> indices;
    if (const auto number = find(primitive, "indices")) {
      indices = rows(*number, "SCALAR", 1);
      if (indices->component == kFloat) fail(name + ": indices are no whole numbers");
    }
    const std::size_t count = indices ? indices->count : places.count;
    if (count % 3 != 0) fail(name + " has " + std::to_string(count) + " corners, not three each");
    const std::size_t built = (corners_.size() + count) / 3 * kBytesPerTriangle;
    if (built > most_built())
      fail(name + ": the triangles of all nodes are far more than the file's");
    const auto texture = texture_of(primitive, *attributes, name);
    const bool is_mirrored = motion.is_mirrored();
    for (std::size_t i = 0; i < count; i += 3) {
      auto& places_in_picture = texture_.emplace_back();
      for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t corner = i + (is_mirrored ? 2 - k : k);
        const std::size_t v = indices ? indices->index(corner) : corner;
        if (v >= places.count)
          fail(name + " refers to vertex " + std::to_string(v) + ", it has " +
               std::to_string(places.count));
        const Vec3d p =
            motion * Vec3d{places.at<float>(v, 0), places.at<float>(v, 1), places.at<float>(v, 2)};
        if (!is_finite(p)) fail(name + ": vertex " + std::to_string(v) + " is not finite");
        corners_.push_back(p);
        if (!texture) continue;
        if (v >= texture->count) fail(name + " has fewer texture coordinates than vertices");
        const double across = texture->share(v, 0), down = texture->share(v, 1);
        if (!std::isfinite(across + down) && fault_.empty())
          fault_ =
              name + ": the texture coordinate of vertex " + std::to_string(v) + " is not finite";
        places_in_picture[k] = {across, 1 - down};
      }
    }
  }

  // Nothing: it has no place in a picture, or none that can be used.
  std::optional<Rows> texture_of(const Json& primitive, const Json& attributes,
                                 const std::string& name) {
    std::size_t set = 0;
    if (const auto material = find(primitive, "material")) {
      note_name("materials", element("materials", *material));
      const Json* colour = member(element("materials", *material), "pbrMetallicRoughness");
      const Json* texture = colour == nullptr ? nullptr : member(*colour, "baseColorTexture");
      if (texture != nullptr) {
        set = find(*texture, "texCoord").value_or(0);
        note_picture(*texture, name);
      }
    }
    const auto number = find(attributes, ("TEXCOORD_" + std::to_string(set)).c_str());
    if (!number) {
      lacks_place_ = true;
      return std::nullopt;
    }
    Rows places = rows(*number, "VEC2", 2);
    if (places.component == kUInt32)
      fail(name + ": texture coordinates are whole numbers of 32 bits");
    return places;
  }

  void note_picture(const Json& texture, const std::string& name) {
    const auto wrong = [&](const std::string& what) {
      if (fault_.empty()) fault_ = name + ": " + what;
    };
    if (const Json* more = member(texture, "extensions"); more != nullptr && !more->empty())
      return wrong("its picture is moved by an extension, which is not read");
    const auto source = find(element("textures", need(texture, "index", name)), "source");
    if (!source) return wrong("its picture is of a kind that is not read: PNG and JPEG are");
    if (!find(element("images", *source), "bufferView"))
      return wrong("its picture is in another file: save all in one");
    if (picture_ && *picture_ != *source)
      return wrong("it has another picture than meshes before it: paint all on one");
    picture_ = source;
  }

  const std::string_view file_;
  std::string_view binary_;
  Json json_;
  std::size_t primitives_ = 0;  // of the nodes so far
  std::size_t skipped_ = 0;     // lists of points or lines
  PartNames parts_;
  std::vector<Vec3d> corners_;
  std::vector<std::array<std::array<double, 2>, 3>> texture_;
  std::optional<std::size_t> picture_;  // number of the image
  bool lacks_place_ = false;            // a triangle has none in a picture
  std::string fault_;
};

}  // namespace

Result<surface::RawSurface> parse_glb(std::string_view bytes, const std::string& name) {
  const auto error = [&](const std::string& what) {
    return Error{ErrorCode::BadFile, name + ": " + what};
  };
  try {
    auto surface = GlbReader(bytes).read();
    if (!surface.texture_fault.empty()) surface.texture_fault = name + ": " + surface.texture_fault;
    return surface;
  } catch (const GlbFault& fault) {
    return error(fault.what);
  }
}

}  // namespace trocar::formats
