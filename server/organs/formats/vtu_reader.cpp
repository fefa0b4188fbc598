#include "server/organs/formats/vtu_reader.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

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
    if (!has_piece_) return fail("has no Piece element");
    return assemble();
  }

 private:
  struct Array {
    VtuSource source;
    std::string components;
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
    if (tag.value("byte_order", "LittleEndian") != "LittleEndian")
      return tags_.error("byte_order must be LittleEndian");
    const auto header = tag.value("header_type", "UInt32"), packer = tag.value("compressor");
    if (header != "UInt32" && header != "UInt64")
      return tags_.error("header_type must be UInt32 or UInt64");
    if (!packer.empty() && packer != "vtkZLibDataCompressor")
      return tags_.error("compressor " + shown(packer) +
                         " is not known: save with vtkZLibDataCompressor or none");
    source_.has_wide_header = header == "UInt64";
    source_.is_packed = !packer.empty();
    source_.file_bytes = file_bytes_;
    return {};
  }

  Status take_piece(const XmlTag& tag) {
    if (std::exchange(has_piece_, true))
      return tags_.error("a second Piece element: save the mesh as one");
    if (!parse_whole(tag.value("NumberOfPoints"), points_) || points_ < 0 ||
        !parse_whole(tag.value("NumberOfCells"), cells_) || cells_ < 0)
      return tags_.error("NumberOfPoints and NumberOfCells must be whole numbers from 0 on");
    return {};
  }

  Status take_array(const XmlTag& tag) {
    const std::string name(tag.value("Name"));
    if (parent_ == "PointData" || parent_ == "FieldData")
      left_out_.push_back((parent_ == "PointData" ? "point data " : "field data ") + shown(name));
    if (!has_piece_ || (parent_ != "Points" && parent_ != "Cells" && parent_ != "CellData"))
      return {};
    Array array{source_, std::string(tag.value("NumberOfComponents", "1"))};
    array.source.type = tag.value("type");
    array.source.format = tag.value("format", "ascii");
    if (tag.kind == XmlTag::Kind::Open) array.source.content = tags_.content();
    if (array.source.format == "appended" && !parse_whole(tag.value("offset"), array.source.offset))
      return tags_.error("appended data need an offset");
    const std::string key = std::string(parent_) + "/" + (parent_ == "Points" ? "" : name);
    if (parent_ != "CellData") {
      if (!arrays_.emplace(key, std::move(array)).second)
        return tags_.error("a second array " + shown(name) + " in " + std::string(parent_));
    } else if (is_region_name(name) && array.components == "1" && !arrays_.contains("CellData/")) {
      arrays_.emplace("CellData/", std::move(array));
      region_data_ = "cell data " + shown(name);
    } else {
      left_out_.push_back("cell data " + shown(name));
    }
    return {};
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

  const Array* find(const std::string& key) {
    const auto found = arrays_.find(key);
    if (found == arrays_.end()) return nullptr;
    found->second.source.appended = source_.appended;
    found->second.source.is_appended_raw = source_.is_appended_raw;
    if (!source_.is_appended_raw)  // its text ends with the element
      found->second.source.appended = source_.appended.substr(0, source_.appended.find('<'));
    return &found->second;
  }

  Result<std::vector<std::int64_t>> wholes(const std::string& key, const char* what) {
    const Array* array = find(key);
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
    const Array* points = find("Points/");
    if (!points) return fail("has no points");
    if (points->components != "3") return fail("points must have NumberOfComponents=\"3\"");
    const auto numbers = read_vtu_numbers(points->source);
    if (!numbers) return fail("points: " + numbers.error().message);
    // Divided, so that no announced number can overflow.
    if (numbers->size() % 3 != 0 || static_cast<std::int64_t>(numbers->size() / 3) != points_)
      return fail("points: " + std::to_string(numbers->size()) + " numbers, the piece announces " +
                  std::to_string(points_) + " points");
    for (std::size_t i = 0; i < numbers->size(); i += 3)
      cells.points.push_back({(*numbers)[i], (*numbers)[i + 1], (*numbers)[i + 2]});
    auto corners = wholes("Cells/connectivity", "connectivity");
    if (!corners) return corners.error();
    auto offsets = wholes("Cells/offsets", "offsets");
    if (!offsets) return offsets.error();
    auto types = wholes("Cells/types", "types");
    if (!types) return types.error();
    for (const auto* list : {&*offsets, &*types})
      if (static_cast<std::int64_t>(list->size()) != cells_)
        return wrong_count(list == &*offsets ? "offsets" : "types", list->size(), cells_);
    std::int64_t last = 0;
    for (const auto offset : *offsets)
      if (offset < last || offset > static_cast<std::int64_t>(corners->size()))
        return fail("offsets: " + std::to_string(offset) + " behind " + std::to_string(last) +
                    ", must ascend to at most " + std::to_string(corners->size()));
      else
        last = offset;
    cells.corners = std::move(*corners);
    cells.ends = std::move(*offsets);
    cells.types = std::move(*types);
    cells.left_out = std::move(left_out_);
    if (const Array* regions = find("CellData/"))
      if (auto s = take_regions_of(regions->source, cells); !s) return s.error();
    return tets_of(std::move(cells), name_);
  }

  Status take_regions_of(const VtuSource& source, VtkCells& cells) {
    if (source.type.starts_with("Float")) {
      const auto numbers = read_vtu_numbers(source);
      if (!numbers) return fail("regions: " + numbers.error().message);
      if (static_cast<std::int64_t>(numbers->size()) != cells_)
        return wrong_count("regions", numbers->size(), cells_);
      take_regions(*numbers, region_data_, cells);
      return {};
    }
    auto regions = wholes("CellData/", "regions");
    if (!regions) return regions.error();
    if (static_cast<std::int64_t>(regions->size()) != cells_)
      return wrong_count("regions", regions->size(), cells_);
    cells.regions = std::move(*regions);
    return {};
  }

  XmlTags tags_;
  const std::string& name_;
  std::size_t file_bytes_;
  bool has_file_ = false, has_piece_ = false;
  std::string_view parent_;
  std::int64_t points_ = 0, cells_ = 0;
  VtuSource source_;  // that which holds for all arrays of the file
  std::map<std::string, Array> arrays_;
  std::string region_data_;
  std::vector<std::string> left_out_;
};

}  // namespace

Result<mesh::RawTets> parse_vtu(std::string_view text, const std::string& name) {
  return VtuReader(text, name).run();
}

}  // namespace trocar::formats
