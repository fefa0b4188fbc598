#include "server/organs/formats/vtk_reader.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>
#include <vector>

#include "server/organs/formats/polygon.h"
#include "server/organs/formats/text_reader.h"
#include "server/organs/formats/vtk_cells.h"

namespace trocar::formats {
namespace {

struct VtkType {
  std::string_view name;
  std::int64_t bytes;
  bool is_unsigned = false;
};
// VTK writes vtkIdType as an int, whatever its own has. Other programs also write the names that it
// has for whole numbers of a fixed size.
constexpr VtkType kVtkTypes[] = {{"char", 1},
                                 {"signed_char", 1},
                                 {"unsigned_char", 1, true},
                                 {"short", 2},
                                 {"int", 4},
                                 {"unsigned_short", 2, true},
                                 {"float", 4},
                                 {"double", 8},
                                 {"unsigned_int", 4, true},
                                 {"long", 8},
                                 {"vtkIdType", 4},
                                 {"unsigned_long", 8, true},
                                 {"vtktypeint8", 1},
                                 {"vtktypeint16", 2},
                                 {"vtktypeuint8", 1, true},
                                 {"vtktypeint32", 4},
                                 {"vtktypeint64", 8},
                                 {"vtktypeuint16", 2, true},
                                 {"vtkidtype", 4},
                                 {"vtktypeuint32", 4, true},
                                 {"vtktypeuint64", 8, true}};

// Bytes of a number of that name; 0: unknown, or of no fixed size.
std::int64_t vtk_size_of(std::string_view type) {
  const auto at = std::ranges::find(kVtkTypes, type, &VtkType::name);
  return at == std::end(kVtkTypes) ? 0 : at->bytes;
}
bool is_unsigned(std::string_view type) {
  const auto at = std::ranges::find(kVtkTypes, type, &VtkType::name);
  return at != std::end(kVtkTypes) && at->is_unsigned;
}

template <typename T>
T big_endian(std::string_view bytes) {
  std::array<char, sizeof(T)> turned{};
  std::reverse_copy(bytes.begin(), bytes.end(), turned.begin());
  return std::bit_cast<T>(turned);
}

class VtkReader {
 public:
  VtkReader(std::string_view text, const std::string& name) : in_(text, name) {}

  Result<TetsOrSurface> run() {
    if (auto s = header(); !s) return s.error();
    while (in_.next_filled_line())
      if (auto s = section(); !s) return s.error();
    if (!has_points_) return in_.error("the file ends without POINTS");
    if (is_surface_) {
      if (!has_cells_) return in_.error("the file ends without POLYGONS");
      if (skipped_ > 0)
        surface_.left_out.push_back("left out " + std::to_string(skipped_) + " points and lines");
      if (!cells_.left_out.empty()) surface_.left_out.push_back(left_out_line(cells_.left_out));
      return TetsOrSurface(std::move(surface_));
    }
    if (!has_cells_) return in_.error("the file ends without CELLS");
    if (cells_.types.size() != cells_.ends.size())
      return in_.error("the file ends without CELL_TYPES");
    auto tets = tets_of(std::move(cells_), in_.name());
    if (!tets) return tets.error();
    return TetsOrSurface(std::move(*tets));
  }

 private:
  Status header() {
    if (!in_.next_line() || !in_.line().starts_with("# vtk DataFile Version "))
      return in_.error("does not begin with '# vtk DataFile Version'");
    in_.next_line();  // a title, of any content
    if (auto s = in_.need_line("the header"); !s) return s;
    if (in_.line() != "ASCII" && in_.line() != "BINARY")
      return in_.error("expected ASCII or BINARY, found " + shown(in_.line()));
    is_binary_ = in_.line() == "BINARY";
    if (auto s = in_.need_line("the header"); !s) return s;
    if (in_.word() != "DATASET") return in_.error("expected DATASET");
    const auto kind = in_.word();
    if (kind != "UNSTRUCTURED_GRID" && kind != "POLYDATA")
      return in_.error("is a " + shown(kind) +
                       ": only UNSTRUCTURED_GRID and POLYDATA can be imported");
    is_surface_ = kind == "POLYDATA";
    return {};
  }

  Status section() {
    const std::string keyword(in_.word());
    if (keyword == "POINTS") return points();
    if (keyword == "CELLS" && !is_surface_) return cells(true);
    if (keyword == "POLYGONS" && is_surface_) return cells(true);
    if ((keyword == "VERTICES" || keyword == "LINES") && is_surface_) return cells(false);
    if (keyword == "TRIANGLE_STRIPS") return in_.error("has TRIANGLE_STRIPS: save it as triangles");
    if (keyword == "CELL_TYPES" && !is_surface_) return cell_types();
    if (keyword == "CELL_DATA" || keyword == "POINT_DATA") return data_header(keyword);
    if (keyword == "METADATA") return skip_metadata();
    if (keyword == "FIELD") return field();
    if (data_count_ >= 0) return attribute(keyword);
    return in_.error(shown(keyword) + " is not expected here");
  }

  Status count(const char* what, std::int64_t least_bytes, std::int64_t& value) {
    const auto text = in_.word();
    if (!parse_whole(text, value))
      return in_.error(std::string("number of ") + what + " is " + shown(text) +
                       ", must be a whole number");
    return in_.check_count(value, least_bytes, what);
  }

  Status number(const std::string& type, const std::string& what, double& value) {
    if (!is_binary_) return in_.read_number(what, value);
    const auto bytes = in_.bytes(static_cast<std::size_t>(vtk_size_of(type)));
    if (bytes.empty()) return in_.error("the file ends before " + what + ": it is cut off");
    value = type == "float"    ? static_cast<double>(big_endian<float>(bytes))
            : type == "double" ? big_endian<double>(bytes)
                               : static_cast<double>(whole(type, bytes));
    return std::isfinite(value) ? Status{} : in_.error(what + " is not a finite number");
  }
  Status number(const std::string& type, const std::string& what, std::int64_t& value) {
    if (!is_binary_) return in_.read_whole(what, value);
    const auto bytes = in_.bytes(static_cast<std::size_t>(vtk_size_of(type)));
    if (bytes.empty()) return in_.error("the file ends before " + what + ": it is cut off");
    value = whole(type, bytes);
    return {};
  }

  static std::int64_t whole(const std::string& type, std::string_view bytes) {
    switch (bytes.size()) {
      case 1:
        return is_unsigned(type) ? std::int64_t{static_cast<unsigned char>(bytes[0])}
                                 : static_cast<signed char>(bytes[0]);
      case 2:
        return is_unsigned(type) ? std::int64_t{big_endian<std::uint16_t>(bytes)}
                                 : big_endian<std::int16_t>(bytes);
      case 4:
        return is_unsigned(type) ? std::int64_t{big_endian<std::uint32_t>(bytes)}
                                 : big_endian<std::int32_t>(bytes);
      default:
        return big_endian<std::int64_t>(bytes);
    }
  }

  // Bytes that a number takes at least.
  std::int64_t least_bytes(std::string_view type) const {
    return is_binary_ ? vtk_size_of(type) : 2;
  }

  Status points() {
    if (has_points_) return in_.error("a second POINTS section: a file must have one");
    has_points_ = true;
    const auto count_text = in_.word();
    const std::string type(in_.word());
    if (type != "float" && type != "double")
      return in_.error("points of type " + shown(type) + ": must be float or double");
    std::int64_t count = 0;
    if (!parse_whole(count_text, count))
      return in_.error("number of points is " + shown(count_text) + ", must be a whole number");
    if (auto s = in_.check_count(count, 3 * least_bytes(type), "points"); !s) return s;
    for (std::int64_t i = 0; i < count; ++i) {
      Vec3d p;
      const std::string what = "node " + std::to_string(i) + ": coordinate";
      for (double* c : {&p.x, &p.y, &p.z})
        if (auto s = number(type, what, *c); !s) return s;
      cells_.points.push_back(p);
    }
    if (is_surface_) surface_.positions = std::move(cells_.points);
    return {};
  }

  // One list of corners; kept: it is what the file is about.
  Status cells(bool kept) {
    if (kept && std::exchange(has_cells_, true))
      return in_.error("a second list of cells: a file must have one");
    std::int64_t first = 0, second = 0;
    if (auto s = count("cells", 1, first); !s) return s;
    if (auto s = count("numbers of cells", least_bytes("int"), second); !s) return s;
    List list;
    const bool is_new = next_starts_with("OFFSETS");
    if (auto s = is_new ? offsets_and_corners(first, second, list)
                        : counts_and_corners(first, second, list);
        !s)
      return s;
    if (!kept) {
      skipped_ += list.ends.size();
      return {};
    }
    if (!is_surface_) {
      cells_.corners = std::move(list.corners);
      cells_.ends = std::move(list.ends);
      return {};
    }
    if (!has_points_) return in_.error("POLYGONS comes before POINTS");
    std::int64_t begin = 0, number_of_face = 0;
    for (const std::int64_t end : list.ends) {
      const std::span corners(list.corners.data() + begin, static_cast<std::size_t>(end - begin));
      if (auto s = add_polygon(corners, ++number_of_face, surface_); !s)
        return in_.error(s.error().message);
      begin = end;
    }
    return {};
  }

  struct List {
    std::vector<std::int64_t> corners, ends;
  };

  bool next_starts_with(std::string_view word) const {
    auto rest = in_.text().substr(in_.text().size() - in_.remaining());
    rest = rest.substr(std::min(rest.find_first_not_of(" \t\r\n"), rest.size()));
    return rest.starts_with(word);
  }

  Status counts_and_corners(std::int64_t cell_count, std::int64_t size, List& list) {
    for (std::int64_t c = 0; c < cell_count; ++c) {
      std::int64_t corners = 0, corner = 0;
      const std::string cell = "cell " + std::to_string(c);
      if (auto s = number("int", cell + ": the number of nodes", corners); !s) return s;
      if (corners < 0 || corners > size - static_cast<std::int64_t>(list.corners.size()) - (c + 1))
        return in_.error(cell + " has " + std::to_string(corners) +
                         " nodes, more than the list of " + std::to_string(size) + " numbers has");
      for (std::int64_t i = 0; i < corners; ++i) {
        if (auto s = number("int", cell + ": a node", corner); !s) return s;
        list.corners.push_back(corner);
      }
      list.ends.push_back(static_cast<std::int64_t>(list.corners.size()));
    }
    if (static_cast<std::int64_t>(list.corners.size()) + cell_count != size)
      return in_.error("announced " + std::to_string(size) + " numbers of cells, found " +
                       std::to_string(static_cast<std::int64_t>(list.corners.size()) + cell_count));
    return {};
  }

  // Version 5.1: one offset more than there are cells, then the corners.
  Status offsets_and_corners(std::int64_t offset_count, std::int64_t corner_count, List& list) {
    std::string type;
    if (auto s = typed_list("OFFSETS", type); !s) return s;
    std::int64_t last = 0;
    for (std::int64_t i = 0; i < offset_count; ++i) {
      std::int64_t offset = 0;
      if (auto s = number(type, "an offset", offset); !s) return s;
      if (i == 0 ? offset != 0 : offset < last || offset > corner_count)
        return in_.error("offset " + std::to_string(i) + " is " + std::to_string(offset) +
                         ", must ascend from 0 to " + std::to_string(corner_count));
      if (i > 0) list.ends.push_back(offset);
      last = offset;
    }
    if (last != corner_count)
      return in_.error("the last offset is " + std::to_string(last) + ", must be " +
                       std::to_string(corner_count));
    if (auto s = typed_list("CONNECTIVITY", type); !s) return s;
    for (std::int64_t i = 0; i < corner_count; ++i) {
      std::int64_t corner = 0;
      if (auto s = number(type, "a node of a cell", corner); !s) return s;
      list.corners.push_back(corner);
    }
    return {};
  }

  Status typed_list(std::string_view keyword, std::string& type) {
    if (auto s = in_.need_line(keyword); !s) return s;
    if (in_.word() != keyword) return in_.error("expected " + std::string(keyword));
    type = in_.word();
    if (vtk_size_of(type) == 0 || type == "float" || type == "double")
      return in_.error("numbers of type " + shown(type) + ": must be whole");
    return {};
  }

  Status cell_types() {
    std::int64_t types = 0;
    if (auto s = count("cell types", least_bytes("int"), types); !s) return s;
    if (!has_cells_) return in_.error("CELL_TYPES comes before CELLS");
    if (types != static_cast<std::int64_t>(cells_.ends.size()) || !cells_.types.empty())
      return in_.error("has " + std::to_string(types) + " cell types for " +
                       std::to_string(cells_.ends.size()) + " cells");
    for (std::int64_t i = 0; i < types; ++i) {
      std::int64_t type = 0;
      if (auto s = number("int", "the type of a cell", type); !s) return s;
      cells_.types.push_back(type);
    }
    return {};
  }

  Status data_header(const std::string& keyword) {
    std::int64_t found = 0;
    if (auto s = count("data", 1, found); !s) return s;
    is_cell_data_ = keyword == "CELL_DATA";
    data_count_ = found;
    const auto expected = is_cell_data_ ? cells_.ends.size()
                          : is_surface_ ? surface_.positions.size()
                                        : cells_.points.size();
    if (!(is_cell_data_ && is_surface_) && data_count_ != static_cast<std::int64_t>(expected))
      return in_.error("has " + std::to_string(data_count_) + " data for " +
                       std::to_string(expected) + (is_cell_data_ ? " cells" : " points"));
    return {};
  }

  // SCALARS name type [components] and its table, VECTORS and NORMALS name type, and so on. Colours
  // have a number in the place of a type, which tells how many each has, or how many there are.
  Status attribute(const std::string& keyword) {
    const std::string name(in_.word());
    std::int64_t components = 1, tuples = data_count_;
    if (keyword == "COLOR_SCALARS" || keyword == "LOOKUP_TABLE" ||
        keyword == "TEXTURE_COORDINATES") {
      std::int64_t& number = keyword == "LOOKUP_TABLE" ? tuples : components;
      if (const auto text = in_.word(); !parse_whole(text, number) || number < 0)
        return in_.error(keyword + " needs a number, found " + shown(text));
    }
    const std::string type(keyword == "COLOR_SCALARS" || keyword == "LOOKUP_TABLE"
                               ? (is_binary_ ? "unsigned_char" : "float")
                               : in_.word());
    if (keyword == "SCALARS") {
      if (const auto text = in_.word(); !text.empty() && !parse_whole(text, components))
        return in_.error("number of components is " + shown(text));
      if (next_starts_with("LOOKUP_TABLE")) {
        in_.next_filled_line();
        while (!in_.word().empty()) {
        }
      }
    } else if (keyword == "VECTORS" || keyword == "NORMALS") {
      components = 3;
    } else if (keyword == "TENSORS6") {
      components = 6;
    } else if (keyword == "TENSORS") {
      components = 9;
    } else if (keyword == "LOOKUP_TABLE") {
      components = 4;
    } else if (keyword != "COLOR_SCALARS" && keyword != "TEXTURE_COORDINATES" &&
               keyword != "GLOBAL_IDS" && keyword != "PEDIGREE_IDS" && keyword != "EDGE_FLAGS") {
      return in_.error("data of kind " + shown(keyword) + " cannot be read: save without them");
    }
    if (components < 1 || components > 9) return in_.error("number of components must be 1 to 9");
    return values(name, type, components, tuples);
  }

  Status field() {
    in_.word();  // its name
    std::int64_t arrays = 0;
    if (auto s = count("arrays", 1, arrays); !s) return s;
    for (std::int64_t i = 0; i < arrays; ++i) {
      if (auto s = in_.need_line("FIELD"); !s) return s;
      if (in_.line().starts_with("METADATA")) {
        if (auto s = skip_metadata(); !s) return s;
        if (auto s = in_.need_line("FIELD"); !s) return s;
      }
      const std::string name(in_.word());
      std::int64_t components = 0, tuples = 0;
      if (!parse_whole(in_.word(), components) || components < 0 || components > 1'000'000)
        return in_.error("array " + shown(name) + " needs a number of components");
      if (!parse_whole(in_.word(), tuples) || tuples < 0)
        return in_.error("array " + shown(name) + " needs a number of tuples");
      if (auto s = values(name, std::string(in_.word()), components, tuples); !s) return s;
    }
    return {};
  }

  // Reads over data, or keeps them as regions.
  Status values(const std::string& name, const std::string& type, std::int64_t components,
                std::int64_t tuples) {
    const std::int64_t size = vtk_size_of(type);
    if (size == 0 && type != "bit" && type != "string")
      return in_.error("data " + shown(name) + " of type " + shown(type) +
                       " cannot be read: save without them");
    if (components > 0 && tuples > std::int64_t{1} << 40)
      return in_.error("array " + shown(name) + " announces too many tuples");
    const std::int64_t count = components * tuples;
    const bool is_bits = is_binary_ && type == "bit";
    const std::int64_t least = type == "string" || is_bits ? 1 : least_bytes(type);
    auto s = in_.check_count(is_bits ? (count + 7) / 8 : count, least, "numbers");
    if (!s) return s;
    const std::string data = (data_count_ < 0 ? "field data "
                              : is_cell_data_ ? "cell data "
                                              : "point data ") +
                             shown(name);
    if (is_cell_data_ && data_count_ >= 0 && components == 1 && !is_surface_ && size > 0 &&
        is_region_name(name) && tuples == static_cast<std::int64_t>(cells_.ends.size()) &&
        cells_.regions.empty())
      return regions(data, type, count);
    cells_.left_out.push_back(data);
    bool is_there = true;
    if (type == "string")
      for (std::int64_t i = 0; is_there && i < count; ++i) is_there = skip_string();
    else if (is_binary_)
      is_there =
          count == 0 ||
          !in_.bytes(static_cast<std::size_t>(is_bits ? (count + 7) / 8 : count * size)).empty();
    else
      for (std::int64_t i = 0; is_there && i < count; ++i) is_there = !in_.token().empty();
    if (!is_there) return in_.error("the file ends inside " + shown(name) + ": it is cut off");
    return {};
  }

  // A line as text. In binary files a length goes before, whose two highest bits tell how many
  // bytes it has itself: 8, 4, 2 or 1. False: the file ends.
  bool skip_string() {
    if (!is_binary_) return in_.next_line();
    const auto first = in_.bytes(1);
    if (first.empty()) return false;
    const unsigned head = static_cast<unsigned char>(first[0]);
    const std::size_t more = (8u >> (head >> 6)) - 1;
    const auto rest = in_.bytes(more);
    if (rest.size() != more) return false;
    std::uint64_t length = head & 63;
    for (const char c : rest) length = length << 8 | static_cast<unsigned char>(c);
    return length == 0 || !in_.bytes(length).empty();
  }

  Status regions(const std::string& data, const std::string& type, std::int64_t count) {
    const std::string what = "a number of " + data;
    if (type == "float" || type == "double") {
      std::vector<double> numbers;
      for (std::int64_t i = 0; i < count; ++i)
        if (auto s = number(type, what, numbers.emplace_back()); !s) return s;
      take_regions(numbers, data, cells_);
      return {};
    }
    for (std::int64_t i = 0; i < count; ++i)
      if (auto s = number(type, what, cells_.regions.emplace_back()); !s) return s;
    return {};
  }

  // Lines up to a blank one.
  Status skip_metadata() {
    while (in_.next_line())
      if (in_.line().empty()) return {};
    return {};
  }

  TextReader in_;
  bool is_binary_ = false, is_surface_ = false, has_points_ = false, has_cells_ = false;
  bool is_cell_data_ = false;
  std::int64_t data_count_ = -1;  // -1: no data yet
  std::size_t skipped_ = 0;       // points and lines of a surface
  VtkCells cells_;
  surface::RawSurface surface_;
};

}  // namespace

Result<TetsOrSurface> parse_vtk(std::string_view text, const std::string& name) {
  return VtkReader(text, name).run();
}

}  // namespace trocar::formats
