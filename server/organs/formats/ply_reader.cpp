#include "server/organs/formats/ply_reader.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <vector>

#include "server/organs/formats/polygon.h"
#include "server/organs/formats/text_reader.h"
#include "server/organs/mesh/raw_tets.h"

namespace trocar::formats {
namespace {

constexpr std::int64_t kMaxCorners = 1000;
constexpr std::size_t kMaxProperties = 100;

enum class Type { Int8, UInt8, Int16, UInt16, Int32, UInt32, Float32, Float64 };

std::optional<Type> type_of(std::string_view name) {
  static constexpr std::pair<std::string_view, Type> kTypes[] = {
      {"char", Type::Int8},      {"int8", Type::Int8},       {"uchar", Type::UInt8},
      {"uint8", Type::UInt8},    {"short", Type::Int16},     {"int16", Type::Int16},
      {"ushort", Type::UInt16},  {"uint16", Type::UInt16},   {"int", Type::Int32},
      {"int32", Type::Int32},    {"uint", Type::UInt32},     {"uint32", Type::UInt32},
      {"float", Type::Float32},  {"float32", Type::Float32}, {"double", Type::Float64},
      {"float64", Type::Float64}};
  for (const auto& [key, type] : kTypes)
    if (key == name) return type;
  return std::nullopt;
}

std::size_t ply_size_of(Type type) {
  static constexpr std::size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<std::size_t>(type)];
}

template <typename T>
double ply_number(std::array<char, 8> bytes) {
  std::array<char, sizeof(T)> own{};
  std::copy_n(bytes.begin(), sizeof(T), own.begin());
  return static_cast<double>(std::bit_cast<T>(own));
}

class PlyReader {
 public:
  PlyReader(std::string_view text, const std::string& name) : in_(text, name) {}

  Result<surface::RawSurface> run() {
    if (auto s = header(); !s) return s.error();
    for (const Element& element : elements_)
      if (auto s = read_all(element); !s) return s.error();
    return std::move(surface_);
  }

 private:
  struct Property {
    std::string name;
    Type type = Type::Float32;
    std::optional<Type> count_type;  // of a list
  };
  struct Element {
    std::string name;
    std::int64_t count = 0;
    std::vector<Property> properties;
  };

  Status header() {
    if (!in_.next_line() || in_.line() != "ply") return in_.error("does not begin with 'ply'");
    bool has_format = false;
    while (true) {
      if (auto s = in_.need_line("the header"); !s) return s;
      const auto keyword = in_.word();
      if (keyword == "end_header") break;
      if (keyword == "comment" || keyword == "obj_info") continue;
      Status status;
      if (keyword == "format") {
        status = format();
        has_format = true;
      } else if (keyword == "element") {
        status = element();
      } else if (keyword == "property") {
        status = property();
      } else {
        return in_.error(shown(keyword) + " is not known in a header");
      }
      if (!status) return status;
    }
    if (!has_format) return in_.error("the header has no format");
    bool has_vertices = false;
    for (const Element& e : elements_) {
      if (e.name == "face" && !has_vertices) return in_.error("faces come before vertices");
      has_vertices = has_vertices || e.name == "vertex";
    }
    return has_vertices ? Status{} : in_.error("has no element vertex");
  }

  Status format() {
    const auto kind = in_.word();
    if (kind != "ascii" && kind != "binary_little_endian" && kind != "binary_big_endian")
      return in_.error("format " + shown(kind) + " is not known");
    if (in_.word() != "1.0") return in_.error("only version 1.0 is read");
    is_binary_ = kind != "ascii";
    is_big_endian_ = kind == "binary_big_endian";
    return {};
  }

  Status element() {
    Element element;
    element.name = in_.word();
    const auto text = in_.word();
    if (!parse_whole(text, element.count) || element.count < 0)
      return in_.error("the number of elements is " + shown(text));
    for (const Element& other : elements_)
      if (other.name == element.name) return in_.error("a second element " + shown(element.name));
    if (elements_.size() == kMaxProperties) return in_.error("has more than 100 elements");
    elements_.push_back(std::move(element));
    return {};
  }

  Status property() {
    if (elements_.empty()) return in_.error("a property comes before its element");
    auto& properties = elements_.back().properties;
    if (properties.size() == kMaxProperties) return in_.error("has more than 100 properties");
    Property property;
    auto word = in_.word();
    if (word == "list") {
      property.count_type = type_of(in_.word());
      if (!property.count_type || *property.count_type >= Type::Float32)
        return in_.error("the length of a list must be of a whole type");
      word = in_.word();
    }
    const auto type = type_of(word);
    if (!type) return in_.error("type " + shown(word) + " is not known");
    property.type = *type;
    property.name = in_.word();
    properties.push_back(std::move(property));
    return {};
  }

  Status number(Type type, const std::string& what, double& value) {
    if (!is_binary_) return in_.read_number(what, value);
    const auto size = ply_size_of(type);
    const auto bytes = in_.bytes(size);
    if (bytes.empty()) return in_.error("the file ends before " + what + ": it is cut off");
    std::array<char, 8> own{};
    std::copy(bytes.begin(), bytes.end(), own.begin());
    if (is_big_endian_) std::reverse(own.begin(), own.begin() + static_cast<std::ptrdiff_t>(size));
    switch (type) {
      case Type::Int8:
        value = ply_number<signed char>(own);
        break;
      case Type::UInt8:
        value = ply_number<unsigned char>(own);
        break;
      case Type::Int16:
        value = ply_number<std::int16_t>(own);
        break;
      case Type::UInt16:
        value = ply_number<std::uint16_t>(own);
        break;
      case Type::Int32:
        value = ply_number<std::int32_t>(own);
        break;
      case Type::UInt32:
        value = ply_number<std::uint32_t>(own);
        break;
      case Type::Float32:
        value = ply_number<float>(own);
        break;
      case Type::Float64:
        value = ply_number<double>(own);
        break;
    }
    return std::isfinite(value) ? Status{} : in_.error(what + " is not a finite number");
  }

  Status read_all(const Element& element) {
    if (element.properties.empty()) {
      if (element.count > 0)
        return in_.error("element " + shown(element.name) + " has no property");
      return {};
    }
    std::int64_t least = 0;
    for (const Property& p : element.properties)
      least +=
          is_binary_ ? static_cast<std::int64_t>(ply_size_of(p.count_type.value_or(p.type))) : 2;
    if (auto s = in_.check_count(element.count, least, element.name); !s) return s;
    const auto has = [&](std::string_view name) {
      return std::ranges::find(element.properties, name, &Property::name) !=
             element.properties.end();
    };
    if (element.name == "vertex" && !(has("x") && has("y") && has("z")))
      return in_.error("vertices need the properties x, y and z");
    if (element.name == "face" && !has("vertex_indices") && !has("vertex_index"))
      return in_.error("faces need the list vertex_indices");
    leave_out_properties(element);
    if (element.name != "vertex" && element.name != "face" && element.count > 0)
      surface_.left_out.push_back("left out " + std::to_string(element.count) + " elements " +
                                  shown(element.name));
    for (std::int64_t i = 1; i <= element.count; ++i)
      if (auto s = read_one(element, i); !s) return s;
    return {};
  }

  // Normals follow from the faces.
  void leave_out_properties(const Element& element) {
    static constexpr std::string_view kTaken[] = {
        "x", "y", "z", "nx", "ny", "nz", "vertex_indices", "vertex_index"};
    if (element.name != "vertex" && element.name != "face") return;
    std::vector<std::string> names;
    for (const Property& p : element.properties)
      if (std::ranges::find(kTaken, p.name) == std::end(kTaken)) names.push_back(p.name);
    if (element.count > 0 && !names.empty())
      surface_.left_out.push_back("left out of each " + element.name + ": " + mesh::list_of(names));
  }

  Status read_one(const Element& element, std::int64_t number_of_it) {
    const std::string who = element.name + " " + std::to_string(number_of_it);
    Vec3d p;
    std::vector<std::int64_t> corners;
    for (const Property& property : element.properties) {
      double value = 0;
      const std::string what = who + ": " + property.name;
      if (!property.count_type) {
        if (auto s = number(property.type, what, value); !s) return s;
        if (property.name == "x") p.x = value;
        if (property.name == "y") p.y = value;
        if (property.name == "z") p.z = value;
        continue;
      }
      double length = 0;
      if (auto s = number(*property.count_type, what, length); !s) return s;
      if (!(length >= 0 && length <= kMaxCorners && length == std::floor(length)))
        return in_.error(what + " has a length that is not 0 to 1000");
      const bool is_corners = property.name == "vertex_indices" || property.name == "vertex_index";
      for (int i = 0; i < static_cast<int>(length); ++i) {
        if (auto s = number(property.type, what, value); !s) return s;
        if (!is_corners) continue;
        if (!(std::abs(value) < 1e15 && value == std::floor(value)))
          return in_.error(what + " holds a number that is not whole");
        corners.push_back(static_cast<std::int64_t>(value));
      }
    }
    if (element.name == "vertex") surface_.positions.push_back(p);
    if (element.name != "face") return {};
    auto added = add_polygon(corners, number_of_it, surface_);
    return added ? std::move(added) : Status(in_.error(added.error().message));
  }

  TextReader in_;
  bool is_binary_ = false, is_big_endian_ = false;
  std::vector<Element> elements_;
  surface::RawSurface surface_;
};

}  // namespace

Result<surface::RawSurface> parse_ply(std::string_view text, const std::string& name) {
  return PlyReader(text, name).run();
}

}  // namespace trocar::formats
