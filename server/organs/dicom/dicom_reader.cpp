#include "server/organs/dicom/dicom_reader.h"

#include <dcmtk/dcmdata/dctk.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <memory>

#include "server/organs/dicom/slices.h"

namespace trocar::dicom {
namespace {

namespace fs = std::filesystem;
using label_map::LabelCount;
using label_map::LabelMap;

constexpr std::size_t kMaxVoxels = std::size_t{256} << 20;
constexpr std::size_t kMaxFiles = 4096;
constexpr std::uint32_t kLazyBytes =
    4096;  // longer values stay in the file until they are asked for
constexpr double kMax_mm = 1e6;
// Label map segmentations (supplement 243), which older DCMTK does not name.
constexpr const char* kLabelMapStorage = "1.2.840.10008.5.1.4.1.1.66.7";

struct Plane {
  Vec3d right, down;  // steps between pixels, mm, to the patient's left, back, head
  int columns = 0, rows = 0;
  std::optional<double> spacing_mm;  // between slices

  std::size_t pixels() const {
    return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  }
};

bool starts_as_dicom(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  char begin[132]{};
  return file.read(begin, sizeof begin) && std::string_view(begin + 128, 4) == "DICM";
}

// Says which bits of a stored pixel are its value, and whether it can be below 0.
struct PixelBits {
  int allocated = 8, stored = 8, shift = 0;
  bool is_signed = false;

  int value(const std::uint8_t* bytes, std::size_t i) const {
    const int raw = allocated == 8 ? bytes[i] : bytes[2 * i] | bytes[2 * i + 1] << 8;
    const int value = raw >> shift & ((1 << stored) - 1);
    return is_signed && (value >> (stored - 1) & 1) != 0 ? value - (1 << stored) : value;
  }
};

bool is_close(const Vec3d& a, const Vec3d& b) {
  return length(a - b) <= 1e-3 * length(b);
}

bool is_segmentation(const std::string& storage) {
  return storage == UID_SegmentationStorage || storage == kLabelMapStorage;
}

std::string text_of(DcmItem& item, const DcmTagKey& key) {
  OFString value;
  return item.findAndGetOFString(key, value).good() ? std::string(value.c_str()) : std::string();
}

class Reader {
 public:
  Reader(DcmFileFormat& file, std::string name)
      : data_(*file.getDataset()), name_(std::move(name)) {}

  Error error(const std::string& what) const { return {ErrorCode::BadFile, name_ + ": " + what}; }
  DcmItem& data() { return data_; }
  const std::string& name() const { return name_; }
  // Texts are in the set of characters that the file says. One that is not known here, or not kept
  // to, leaves their bytes as they are.
  void make_utf8() { static_cast<void>(data_.convertToUTF8()); }

  Result<int> whole(const DcmTagKey& key, const char* attribute, int least, int most) {
    Uint16 value = 0;
    if (data_.findAndGetUint16(key, value).bad())
      return error(std::string(attribute) + " is missing");
    if (value < least || value > most)
      return error(fmt::format("{} is {}, must be {} to {}", attribute, value, least, most));
    return int{value};
  }

  // All bits where nothing is said of them.
  Result<PixelBits> pixel_bits() {
    const auto allocated = whole(DCM_BitsAllocated, "BitsAllocated", 8, 16);
    if (!allocated) return allocated.error();
    if (*allocated != 8 && *allocated != 16)
      return error(fmt::format("BitsAllocated is {}, must be 8 or 16", *allocated));
    const auto has = [&](const DcmTagKey& key) { return data_.tagExistsWithValue(key); };
    const auto stored =
        has(DCM_BitsStored) ? whole(DCM_BitsStored, "BitsStored", 1, *allocated) : allocated;
    if (!stored) return stored.error();
    const auto high = has(DCM_HighBit) ? whole(DCM_HighBit, "HighBit", *stored - 1, *allocated - 1)
                                       : Result<int>(*stored - 1);
    if (!high) return high.error();
    const auto sign = has(DCM_PixelRepresentation)
                          ? whole(DCM_PixelRepresentation, "PixelRepresentation", 0, 1)
                          : Result<int>(0);
    if (!sign) return sign.error();
    return PixelBits{*allocated, *stored, *high + 1 - *stored, *sign == 1};
  }

  Result<std::vector<double>> numbers(DcmItem& item, const DcmTagKey& key, const char* attribute,
                                      unsigned long count) const {
    std::vector<double> values(count);
    for (unsigned long i = 0; i < count; ++i)
      if (item.findAndGetFloat64(key, values[i], i).bad() || !(std::abs(values[i]) < kMax_mm))
        return error(fmt::format("{} has not {} numbers below 1,000,000", attribute, count));
    return values;
  }

  // orientation and measures: the items that have these attributes.
  Result<Plane> plane(DcmItem& orientation, DcmItem& measures) {
    const auto directions =
        numbers(orientation, DCM_ImageOrientationPatient, "ImageOrientationPatient", 6);
    if (!directions) return directions.error();
    const auto spacing = numbers(measures, DCM_PixelSpacing, "PixelSpacing", 2);
    if (!spacing) return spacing.error();
    const auto rows = whole(DCM_Rows, "Rows", 1, 65535);
    if (!rows) return rows.error();
    const auto columns = whole(DCM_Columns, "Columns", 1, 65535);
    if (!columns) return columns.error();
    const auto& d = *directions;
    Plane plane{.right = Vec3d{d[0], d[1], d[2]} * (*spacing)[1],
                .down = Vec3d{d[3], d[4], d[5]} * (*spacing)[0],
                .columns = *columns,
                .rows = *rows,
                .spacing_mm = {}};
    for (const auto& key : {DCM_SpacingBetweenSlices, DCM_SliceThickness})
      if (double value = 0; !plane.spacing_mm && measures.findAndGetFloat64(key, value).good() &&
                            value > 0 && value < kMax_mm)
        plane.spacing_mm = value;
    return plane;
  }

  Result<Vec3d> place(DcmItem& item) const {
    const auto p = numbers(item, DCM_ImagePositionPatient, "ImagePositionPatient", 3);
    if (!p) return p.error();
    return Vec3d{(*p)[0], (*p)[1], (*p)[2]};
  }

  // The pixels as they are stored. Error: they are fewer than `bytes`, or compressed.
  Result<const std::uint8_t*> pixels(std::size_t bytes) {
    const DcmXfer transfer(data_.getOriginalXfer());
    if (transfer.isEncapsulated())
      return error(std::string("its pixels are compressed (") + transfer.getXferName() +
                   "): save it uncompressed");
    DcmElement* element = nullptr;
    if (data_.findAndGetElement(DCM_PixelData, element).bad()) return error("PixelData is missing");
    if (element->getLength() < bytes)
      return error(fmt::format("PixelData has {} bytes, {} are needed: it is cut off",
                               element->getLength(), bytes));
    Uint8* narrow = nullptr;
    Uint16* wide = nullptr;
    if (element->getUint8Array(narrow).good() && narrow) return narrow;
    if (element->getUint16Array(wide).good() && wide)
      return reinterpret_cast<const std::uint8_t*>(wide);
    return error("PixelData cannot be read");
  }

 private:
  DcmDataset& data_;
  std::string name_;
};

Result<std::unique_ptr<DcmFileFormat>> open(const fs::path& path) {
  OFLog::configure(OFLogger::OFF_LOG_LEVEL);
  auto file = std::make_unique<DcmFileFormat>();
  const auto read =
      file->loadFile(path.c_str(), EXS_Unknown, EGL_noChange, kLazyBytes, ERM_autoDetect);
  if (read.bad() || !file->getDataset())
    return Error{ErrorCode::BadFile,
                 path.string() + ": cannot be read as DICOM: " + std::string(read.text())};
  return file;
}

// The first item of a sequence that is there once; null without it.
DcmItem* only_item(DcmItem& item, const DcmTagKey& key) {
  DcmItem* found = nullptr;
  return item.findAndGetSequenceItem(key, found, 0).good() ? found : nullptr;
}

Result<LabelMap> make_map(const Plane& plane, const SliceGrid& grid, const Reader& reader) {
  LabelMap map;
  map.size = {plane.columns, plane.rows, grid.count};
  const double voxels = static_cast<double>(plane.pixels()) * static_cast<double>(grid.count);
  if (voxels > static_cast<double>(kMaxVoxels))
    return reader.error(fmt::format("{} x {} x {} voxels are more than {}: crop or coarsen it",
                                    plane.columns, plane.rows, grid.count, kMaxVoxels));
  // From left, back, head in mm to left, head, front in m.
  const auto turned = [](const Vec3d& v) { return Vec3d{v.x, v.z, -v.y} * 1e-3; };
  if (auto s = set_place(turned(grid.origin),
                         {turned(plane.right), turned(plane.down), turned(grid.step)}, map);
      !s)
    return reader.error(s.error().message);
  map.labels.resize(plane.pixels() * static_cast<std::size_t>(grid.count));
  return map;
}

class SegmentationReader {
 public:
  explicit SegmentationReader(Reader& reader) : reader_(reader) {}

  Result<LabelMap> run() {
    for (auto step : {&SegmentationReader::read_kind, &SegmentationReader::read_segments,
                      &SegmentationReader::read_frames})
      if (auto s = (this->*step)(); !s) return s.error();
    const auto grid = arrange_slices(places_, plane_.right, plane_.down, plane_.spacing_mm, true);
    if (!grid) return reader_.error(grid.error().message);
    auto map = make_map(plane_, *grid, reader_);
    if (!map) return map.error();
    if (auto s = fill(*grid, *map); !s) return s.error();
    map->names = std::move(names_);
    return map;
  }

 private:
  Status read_kind() {
    const std::string kind = text_of(reader_.data(), DCM_SegmentationType);
    is_binary_ = kind == "BINARY";
    is_label_map_ = kind == "LABELMAP";
    if (!is_binary_ && !is_label_map_ && kind != "FRACTIONAL")
      return reader_.error("SegmentationType is none of BINARY, FRACTIONAL, LABELMAP");
    if (is_label_map_) {
      const auto found = reader_.pixel_bits();
      if (!found) return found.error();
      bits_ = *found;
      return {};
    }
    const int bits = is_binary_ ? 1 : 8;
    if (auto b = reader_.whole(DCM_BitsAllocated, "BitsAllocated", bits, bits); !b)
      return b.error();
    if (!is_binary_) {
      const auto most = reader_.whole(DCM_MaximumFractionalValue, "MaximumFractionalValue", 1, 255);
      if (!most) return most.error();
      half_ = (*most + 1) / 2;
    }
    return {};
  }

  Status read_segments() {
    reader_.make_utf8();
    DcmItem* segment = nullptr;
    for (long i = 0; reader_.data().findAndGetSequenceItem(DCM_SegmentSequence, segment, i).good();
         ++i) {
      Uint16 number = 0;
      const bool has_number = segment->findAndGetUint16(DCM_SegmentNumber, number).good();
      if (has_number && number == 0 && is_label_map_) continue;  // the background
      if (!has_number || number == 0)
        return reader_.error(fmt::format("segment {} has no SegmentNumber from 1 to 65535", i + 1));
      names_.emplace_back(number, text_of(*segment, DCM_SegmentLabel));
    }
    if (names_.empty()) return reader_.error("SegmentSequence is empty");
    return {};
  }

  // Returns what stands in the groups of a frame, or else in those that all frames share; null: in
  // neither.
  DcmItem* group(DcmItem& frame, const DcmTagKey& key) {
    if (auto* own = only_item(frame, key)) return own;
    auto* shared = only_item(reader_.data(), DCM_SharedFunctionalGroupsSequence);
    return shared ? only_item(*shared, key) : nullptr;
  }

  // The same for all frames.
  Status read_plane(DcmItem& frame, const std::string& begin) {
    auto* orientation = group(frame, DCM_PlaneOrientationSequence);
    if (!orientation) return reader_.error("PlaneOrientationSequence is missing");
    auto* measures = group(frame, DCM_PixelMeasuresSequence);
    if (!measures) return reader_.error("PixelMeasuresSequence is missing");
    auto plane = reader_.plane(*orientation, *measures);
    if (!plane) return plane.error();
    if (places_.empty())
      plane_ = *plane;
    else if (!is_close(plane->right, plane_.right) || !is_close(plane->down, plane_.down))
      return reader_.error(begin + "has other directions or distances than the first one");
    return {};
  }

  Status read_frames() {
    DcmItem* frame = nullptr;
    for (long i = 0; reader_.data()
                         .findAndGetSequenceItem(DCM_PerFrameFunctionalGroupsSequence, frame, i)
                         .good();
         ++i) {
      const std::string begin = fmt::format("frame {}: ", i + 1);
      if (auto s = read_plane(*frame, begin); !s) return s;
      auto* position = group(*frame, DCM_PlanePositionSequence);
      if (!position) return reader_.error(begin + "PlanePositionSequence is missing");
      const auto place = reader_.place(*position);
      if (!place) return place.error();
      places_.push_back(*place);
      if (is_label_map_) continue;
      auto* identity = group(*frame, DCM_SegmentIdentificationSequence);
      Uint16 number = 0;
      if (!identity || identity->findAndGetUint16(DCM_ReferencedSegmentNumber, number).bad())
        return reader_.error(begin + "ReferencedSegmentNumber is missing");
      if (!has_segment(number))
        return reader_.error(fmt::format("{}there is no segment {}", begin, number));
      segments_.push_back(number);
    }
    return places_.empty() ? Status(reader_.error("has no frames")) : Status{};
  }

  bool has_segment(int number) const {
    return std::ranges::find(names_, number, &std::pair<std::uint16_t, std::string>::first) !=
           names_.end();
  }

  Status fill(const SliceGrid& grid, LabelMap& map) {
    if (is_label_map_) return fill_labels(grid, map);
    const std::size_t size = plane_.pixels(), all = size * places_.size();
    const auto stored = reader_.pixels(is_binary_ ? (all + 7) / 8 : all);
    if (!stored) return stored.error();
    const std::uint8_t* bytes = *stored;
    std::size_t twice = 0;
    for (std::size_t f = 0; f < places_.size(); ++f) {
      auto* slice = map.labels.data() + size * static_cast<std::size_t>(grid.slice_of_places[f]);
      for (std::size_t i = 0, at = f * size; i < size; ++i, ++at) {
        const bool is_in = is_binary_ ? (bytes[at / 8] >> (at % 8) & 1) != 0 : bytes[at] >= half_;
        if (!is_in) continue;
        twice += slice[i] != 0 && slice[i] != segments_[f];
        slice[i] = std::max(slice[i], segments_[f]);
      }
    }
    if (twice > 0)
      map.warnings.push_back(
          fmt::format("segments overlap in {} voxels, which the higher number has", twice));
    return {};
  }

  // Each pixel is the number of its segment.
  Status fill_labels(const SliceGrid& grid, LabelMap& map) {
    const std::size_t size = plane_.pixels(), all = size * places_.size();
    const auto stored = reader_.pixels(all * static_cast<std::size_t>(bits_.allocated) / 8);
    if (!stored) return stored.error();
    std::vector<std::uint8_t> is_filled(static_cast<std::size_t>(grid.count), 0);
    for (std::size_t f = 0; f < places_.size(); ++f) {
      const auto place = static_cast<std::size_t>(grid.slice_of_places[f]);
      if (std::exchange(is_filled[place], std::uint8_t{1}))
        return reader_.error(fmt::format("frame {}: another frame stands at its position", f + 1));
      for (std::size_t i = 0; i < size; ++i) {
        const int label = bits_.value(*stored, f * size + i);
        if (label != 0 && !has_segment(label))
          return reader_.error(fmt::format("frame {}: there is no segment {}", f + 1, label));
        map.labels[size * place + i] = static_cast<std::uint16_t>(label);
      }
    }
    return {};
  }

  Reader& reader_;
  Plane plane_;
  bool is_binary_ = true, is_label_map_ = false;
  PixelBits bits_;  // of a label map
  int half_ = 1;    // a fractional voxel belongs to its segment from this value on
  std::vector<std::pair<std::uint16_t, std::string>> names_;
  std::vector<Vec3d> places_;            // by frame
  std::vector<std::uint16_t> segments_;  // by frame
};

class SeriesReader {
 public:
  explicit SeriesReader(const fs::path& folder) : folder_(folder) {}

  Result<LabelMap> run() {
    if (auto s = list(); !s) return s.error();
    for (const auto& path : files_)
      if (auto s = read_place(path); !s) return s.error();
    const auto grid = arrange_slices(places_, plane_.right, plane_.down, plane_.spacing_mm, false);
    if (!grid) return error(grid.error().message);
    if (grid->count != static_cast<int>(files_.size()))
      return error(fmt::format("{} slices stand at {} positions: it is more than one series",
                               files_.size(), grid->count));
    auto map = Result<LabelMap>(LabelMap{});
    for (std::size_t i = 0; i < files_.size(); ++i)
      if (auto s = read_pixels(i, *grid, map); !s) return s.error();
    return map;
  }

 private:
  Error error(const std::string& what) const {
    return {ErrorCode::BadFile, folder_.string() + ": " + what};
  }

  Status list() {
    std::error_code failed;
    for (fs::directory_iterator it(folder_, failed), end; !failed && it != end;
         it.increment(failed))
      if (it->is_regular_file(failed) && it->path().filename() != "DICOMDIR" &&
          starts_as_dicom(it->path())) {
        files_.push_back(it->path());
        if (files_.size() > kMaxFiles)
          return error(fmt::format("has more than {} files", kMaxFiles));
      }
    if (failed) return error("cannot be read: " + failed.message());
    if (files_.empty()) return error("holds no DICOM file");
    std::ranges::sort(files_);
    return {};
  }

  Status read_place(const fs::path& path) {
    const auto file = open(path);
    if (!file) return file.error();
    Reader reader(**file, path.string());
    if (is_segmentation(text_of(reader.data(), DCM_SOPClassUID)))
      return reader.error("is a segmentation: import this file by itself");
    const std::string series = text_of(reader.data(), DCM_SeriesInstanceUID);
    auto plane = reader.plane(reader.data(), reader.data());
    if (!plane) return plane.error();
    if (places_.empty()) {
      plane_ = *plane, series_ = series;
    } else if (series != series_) {
      return reader.error("is of another series than the files before: give each a folder");
    } else if (plane->columns != plane_.columns || plane->rows != plane_.rows ||
               !is_close(plane->right, plane_.right) || !is_close(plane->down, plane_.down)) {
      return reader.error("has other rows, columns or directions than the slices before");
    }
    const auto place = reader.place(reader.data());
    if (!place) return place.error();
    places_.push_back(*place);
    return {};
  }

  Status read_pixels(std::size_t i, const SliceGrid& grid, Result<LabelMap>& map) {
    const auto file = open(files_[i]);
    if (!file) return file.error();
    Reader reader(**file, files_[i].string());
    for (const auto& [key, attribute, plain] :
         {std::tuple{DCM_RescaleSlope, "RescaleSlope", 1.0},
          std::tuple{DCM_RescaleIntercept, "RescaleIntercept", 0.0}})
      if (double value = plain;
          reader.data().findAndGetFloat64(key, value).good() && value != plain)
        return reader.error(fmt::format("{} is {}: {}", attribute, value, label_map::kGreyValues));
    if (auto n = reader.whole(DCM_SamplesPerPixel, "SamplesPerPixel", 1, 1); !n) return n.error();
    const auto bits = reader.pixel_bits();
    if (!bits) return bits.error();
    const std::size_t size = plane_.pixels();
    const auto stored = reader.pixels(size * static_cast<std::size_t>(bits->allocated) / 8);
    if (!stored) return stored.error();
    if (i == 0) {
      map = make_map(plane_, grid, reader);
      if (!map) return map.error();
    }
    auto* slice = map->labels.data() + size * static_cast<std::size_t>(grid.slice_of_places[i]);
    for (std::size_t k = 0; k < size; ++k) {
      const int label = bits->value(*stored, k);
      if (label < 0)
        return reader.error(fmt::format("pixel ({}, {}) is {}, which is no label: {}",
                                        k % static_cast<std::size_t>(plane_.columns),
                                        k / static_cast<std::size_t>(plane_.columns), label,
                                        "labels are whole numbers from 0 to 65535"));
      slice[k] = static_cast<std::uint16_t>(label);
      if (!labels_.add(slice[k])) return reader.error(LabelCount::error());
    }
    return {};
  }

  fs::path folder_;
  std::vector<fs::path> files_;
  std::string series_;
  Plane plane_;
  std::vector<Vec3d> places_;  // by file
  LabelCount labels_;          // of all files so far
};

}  // namespace

bool is_dicom(const fs::path& path) {
  std::error_code failed;
  return fs::is_directory(path, failed) || starts_as_dicom(path);
}

Result<LabelMap> read_dicom(const fs::path& path) {
  std::error_code failed;
  if (fs::is_directory(path, failed)) return SeriesReader(path).run();
  const auto file = open(path);
  if (!file) return file.error();
  Reader reader(**file, path.string());
  if (!is_segmentation(text_of(reader.data(), DCM_SOPClassUID)))
    return reader.error("is one image: import the folder of its series, or a segmentation");
  return SegmentationReader(reader).run();
}

}  // namespace trocar::dicom
