#include "server/organs/formats/vtu_reader.h"

#include <algorithm>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "server/organs/formats/text_reader.h"
#include "server/organs/formats/vtk_cells.h"
#include "server/organs/formats/vtu_array.h"
#include "server/organs/formats/xml_tags.h"

namespace trocar::formats {
namespace {

class VtuReader {
 public:
  VtuReader(std::string_view text, const std::string& name)
      : tags_(text, name), name_(name), file_bytes_(text.size()) {}

  Result<mesh::RawTets> run() {
    XmlTag tag;
    while (true) {
      const auto more = tags_.next(tag);
      if (!more) return more.error();
      if (!*more) break;
      if (auto s = take(tag); !s) return s.error();
      if (!source_.appended.empty()) break;
    }
    if (!has_file_) return fail("has no VTKFile element");
    if (pieces_.empty()) return fail("has no Piece element");
    return assemble();
  }

 private:
  struct Array {
    VtuSource source;
    std::string components;
  };
  struct Piece {
    std::int64_t points = 0, cells = 0;
    std::map<std::string, Array> arrays;
    std::string region_data;  // of which the regions are
  };

  Error fail(const std::string& what) const { return {ErrorCode::BadFile, name_ + ": " + what}; }

  Status take(const XmlTag& tag) {
    if (tag.kind == XmlTag::Kind::Close) {
      if (tag.name == parent_) parent_ = {};
      return {};
    }
    if (tag.name == "VTKFile") return take_file(tag);
    if (!has_file_) return tags_.error("does not begin with a VTKFile element");
    if (tag.name == "Piece") return take_piece(tag);
    if (tag.name == "DataArray") return take_array(tag);
    if (tag.name == "Array" && !parent_.empty() && tag.kind != XmlTag::Kind::Close)  // of texts
      leave_out(kind_of_data() + shown(tag.value("Name")));
    if (tag.name == "AppendedData") return take_appended(tag);
    for (const auto* parent : {"Points", "Cells", "CellData", "PointData", "FieldData"})
      if (tag.name == parent && tag.kind == XmlTag::Kind::Open) parent_ = parent;
    return {};
  }

  Status take_file(const XmlTag& tag) {
    has_file_ = true;
    if (tag.value("type") != "UnstructuredGrid")
      return tags_.error("is of type " + shown(tag.value("type")) +
                         ": only an UnstructuredGrid can be imported");
    const auto order = tag.value("byte_order", "LittleEndian");
    if (order != "LittleEndian" && order != "BigEndian")
      return tags_.error("byte_order must be LittleEndian or BigEndian");
    const auto header = tag.value("header_type", "UInt32"), packer = tag.value("compressor");
    if (header != "UInt32" && header != "UInt64")
      return tags_.error("header_type must be UInt32 or UInt64");
    if (!packer.empty() && packer != "vtkZLibDataCompressor")
      return tags_.error("compressor " + shown(packer) +
                         " is not known: save with vtkZLibDataCompressor or none");
    source_.is_big_endian = order == "BigEndian";
    source_.has_wide_header = header == "UInt64";
    source_.is_packed = !packer.empty();
    source_.file_bytes = file_bytes_;
    return {};
  }

  Status take_piece(const XmlTag& tag) {
    Piece& piece = pieces_.emplace_back();
    if (!parse_whole(tag.value("NumberOfPoints"), piece.points) || piece.points < 0 ||
        !parse_whole(tag.value("NumberOfCells"), piece.cells) || piece.cells < 0)
      return tags_.error("NumberOfPoints and NumberOfCells must be whole numbers from 0 on");
    return {};
  }

  Status take_array(const XmlTag& tag) {
    const std::string name(tag.value("Name"));
    if (parent_ == "PointData" || parent_ == "FieldData") leave_out(kind_of_data() + shown(name));
    if (pieces_.empty() || (parent_ != "Points" && parent_ != "Cells" && parent_ != "CellData"))
      return {};
    Array array{source_, std::string(tag.value("NumberOfComponents", "1"))};
    array.source.type = tag.value("type");
    array.source.format = tag.value("format", "ascii");
    if (tag.kind == XmlTag::Kind::Open) array.source.content = tags_.content();
    if (array.source.format == "appended" && !parse_whole(tag.value("offset"), array.source.offset))
      return tags_.error("appended data need an offset");
    const std::string key = std::string(parent_) + "/" + (parent_ == "Points" ? "" : name);
    auto& [points, cells, arrays, region_data] = pieces_.back();
    if (parent_ != "CellData") {
      if (!arrays.emplace(key, std::move(array)).second)
        return tags_.error("a second array " + shown(name) + " in " + std::string(parent_));
    } else if (is_region_name(name) && array.components == "1" && !arrays.contains("CellData/")) {
      arrays.emplace("CellData/", std::move(array));
      region_data = "cell data " + shown(name);
    } else {
      leave_out("cell data " + shown(name));
    }
    return {};
  }

  std::string kind_of_data() const {
    return parent_ == "PointData"   ? "point data "
           : parent_ == "FieldData" ? "field data "
                                    : "cell data ";
  }

  // Once for all pieces.
  void leave_out(const std::string& data) {
    if (std::ranges::find(left_out_, data) == left_out_.end()) left_out_.push_back(data);
  }

  Status take_appended(const XmlTag& tag) {
    const auto encoding = tag.value("encoding");
    if (encoding != "raw" && encoding != "base64")
      return tags_.error("encoding of appended data must be raw or base64");
    const auto rest = tags_.rest();
    const auto underscore = rest.find('_');
    if (underscore == std::string_view::npos)
      return tags_.error("appended data must begin with an underscore");
    source_.is_appended_raw = encoding == "raw";
    source_.appended = rest.substr(underscore + 1);
    if (source_.appended.empty()) return tags_.error("appended data are missing");
    return {};
  }

  const Array* find(Piece& piece, const std::string& key) {
    const auto found = piece.arrays.find(key);
    if (found == piece.arrays.end()) return nullptr;
    found->second.source.appended = source_.appended;
    found->second.source.is_appended_raw = source_.is_appended_raw;
    if (!source_.is_appended_raw)  // its text ends with the element
      found->second.source.appended = source_.appended.substr(0, source_.appended.find('<'));
    return &found->second;
  }

  Result<std::vector<std::int64_t>> wholes(Piece& piece, const std::string& key, const char* what) {
    const Array* array = find(piece, key);
    if (!array) return fail(std::string("has no ") + what);
    auto values = read_vtu_wholes(array->source);
    if (!values) return fail(std::string(what) + ": " + values.error().message);
    return values;
  }

  Error wrong_count(const char* what, std::size_t found, std::int64_t expected) const {
    return fail(std::string(what) + ": " + std::to_string(found) +
                " numbers, the piece announces " + std::to_string(expected));
  }

  Result<mesh::RawTets> assemble() {
    VtkCells cells;
    // Pieces without regions are of region 0 beside others.
    bool has_regions = false;
    for (Piece& piece : pieces_) {
      if (piece.points == 0 && piece.cells == 0) continue;
      if (auto s = add(piece, cells); !s) return s.error();
      has_regions = has_regions || cells.regions.size() == cells.types.size();
    }
    cells.regions.resize(has_regions ? cells.types.size() : 0);
    cells.left_out.insert(cells.left_out.begin(), left_out_.begin(), left_out_.end());
    return tets_of(std::move(cells), name_);
  }

  // Nodes on the border of two pieces are in both, and welded later.
  Status add(Piece& piece, VtkCells& cells) {
    const auto nodes_before = static_cast<std::int64_t>(cells.points.size());
    const auto corners_before = static_cast<std::int64_t>(cells.corners.size());
    const Array* points = find(piece, "Points/");
    if (!points) return fail("has no points");
    if (points->components != "3") return fail("points must have NumberOfComponents=\"3\"");
    const auto numbers = read_vtu_numbers(points->source);
    if (!numbers) return fail("points: " + numbers.error().message);
    // Divided, so that no announced number can overflow.
    if (numbers->size() % 3 != 0 || static_cast<std::int64_t>(numbers->size() / 3) != piece.points)
      return fail("points: " + std::to_string(numbers->size()) + " numbers, the piece announces " +
                  std::to_string(piece.points) + " points");
    for (std::size_t i = 0; i < numbers->size(); i += 3)
      cells.points.push_back({(*numbers)[i], (*numbers)[i + 1], (*numbers)[i + 2]});
    const auto corners = wholes(piece, "Cells/connectivity", "connectivity");
    if (!corners) return corners.error();
    const auto offsets = wholes(piece, "Cells/offsets", "offsets");
    if (!offsets) return offsets.error();
    const auto types = wholes(piece, "Cells/types", "types");
    if (!types) return types.error();
    for (const auto* list : {&*offsets, &*types})
      if (static_cast<std::int64_t>(list->size()) != piece.cells)
        return wrong_count(list == &*offsets ? "offsets" : "types", list->size(), piece.cells);
    std::int64_t last = 0;
    for (const auto offset : *offsets) {
      if (offset < last || offset > static_cast<std::int64_t>(corners->size()))
        return fail("offsets: " + std::to_string(offset) + " behind " + std::to_string(last) +
                    ", must ascend to at most " + std::to_string(corners->size()));
      cells.ends.push_back(corners_before + (last = offset));
    }
    for (const auto corner : std::span(*corners).first(static_cast<std::size_t>(last))) {
      if (corner < 0 || corner >= piece.points)
        return fail("connectivity refers to node " + std::to_string(corner) + ", the piece has " +
                    std::to_string(piece.points) + ", counted from 0");
      cells.corners.push_back(nodes_before + corner);
    }
    const Array* regions = find(piece, "CellData/");
    if (regions) cells.regions.resize(cells.types.size());
    cells.types.insert(cells.types.end(), types->begin(), types->end());
    return regions ? take_regions_of(regions->source, piece, cells) : Status{};
  }

  Status take_regions_of(const VtuSource& source, Piece& piece, VtkCells& cells) {
    if (source.type.starts_with("Float")) {
      const auto numbers = read_vtu_numbers(source);
      if (!numbers) return fail("regions: " + numbers.error().message);
      if (static_cast<std::int64_t>(numbers->size()) != piece.cells)
        return wrong_count("regions", numbers->size(), piece.cells);
      take_regions(*numbers, piece.region_data, cells);
      return {};
    }
    const auto regions = wholes(piece, "CellData/", "regions");
    if (!regions) return regions.error();
    if (static_cast<std::int64_t>(regions->size()) != piece.cells)
      return wrong_count("regions", regions->size(), piece.cells);
    cells.regions.insert(cells.regions.end(), regions->begin(), regions->end());
    return {};
  }

  XmlTags tags_;
  const std::string& name_;
  std::size_t file_bytes_;
  bool has_file_ = false;
  std::string_view parent_;
  VtuSource source_;  // that which holds for all arrays of the file
  std::vector<Piece> pieces_;
  std::vector<std::string> left_out_;
};

}  // namespace

Result<mesh::RawTets> parse_vtu(std::string_view text, const std::string& name) {
  return VtuReader(text, name).run();
}

}  // namespace trocar::formats
