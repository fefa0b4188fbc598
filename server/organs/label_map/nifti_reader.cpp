#include "server/organs/label_map/nifti_reader.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "common/base/inflate.h"
#include "server/organs/formats/mesh_file.h"

namespace trocar::label_map {
namespace {

constexpr std::size_t kHeaderBytes = 348, kHeaderBytes2 = 540;  // of NIfTI-1 and NIfTI-2
constexpr std::size_t kMaxBytes = std::size_t{512} << 20;
constexpr int kMaxLabel = 65535;

struct StoredType {
  int code, bytes;
  const char* name;
};
constexpr StoredType kStoredTypes[] = {{2, 1, "uint8"},    {4, 2, "int16"},    {8, 4, "int32"},
                                       {16, 4, "float32"}, {64, 8, "float64"}, {256, 1, "int8"},
                                       {512, 2, "uint16"}, {768, 4, "uint32"}, {1024, 8, "int64"}};

std::string stored_types() {
  std::string text;
  for (const auto& type : kStoredTypes) text += (text.empty() ? "" : ", ") + std::string(type.name);
  return text;
}

Result<std::string> gunzip(std::string_view packed, const std::string& name) {
  std::string out;
  auto s = inflate_into(packed, Packing::Gzip, kMaxBytes, out);
  if (out.size() > kMaxBytes)
    return Error{ErrorCode::BadFile, name + ": unpacks to more than 512 MiB: crop or coarsen it"};
  if (!s) return Error{ErrorCode::BadFile, name + ": " + s.error().message};
  return out;
}

// Holds what both kinds of headers say, in other places and widths.
struct Header {
  std::array<std::int64_t, 8> dim{};
  std::array<double, 8> pixdim{};
  std::int64_t datatype = 0, qform = 0, sform = 0, units = 0;
  double vox_offset = 0, slope = 0, inter = 0;
  std::array<double, 3> quatern{}, qoffset{};
  std::array<double, 12> srow{};
};

class NiftiReader {
 public:
  NiftiReader(std::string_view bytes, std::optional<mesh::Unit> unit, const std::string& name)
      : bytes_(bytes), unit_(unit), name_(name) {}

  Result<LabelMap> run() {
    for (auto step : {&NiftiReader::check_header, &NiftiReader::read_size, &NiftiReader::read_unit,
                      &NiftiReader::read_place, &NiftiReader::read_labels})
      if (auto s = (this->*step)(); !s) return s.error();
    map_.unit_m = scale_;
    return std::move(map_);
  }

 private:
  Error error(const std::string& what) const { return {ErrorCode::BadFile, name_ + ": " + what}; }

  template <typename T>
  T at(std::size_t offset) const {
    std::array<char, sizeof(T)> own{};
    std::copy_n(bytes_.data() + offset, sizeof(T), own.begin());
    if (is_big_endian_) std::ranges::reverse(own);
    return std::bit_cast<T>(own);
  }

  Status check_header() {
    if (bytes_.size() < kHeaderBytes)
      return error("has " + std::to_string(bytes_.size()) + " bytes, a header has 348");
    is_big_endian_ = bytes_[0] == 0;
    const auto size = at<std::int32_t>(0);
    if (size != std::int32_t{kHeaderBytes} && size != std::int32_t{kHeaderBytes2})
      return error("sizeof_hdr is " + std::to_string(size) +
                   ", must be 348 or 540: it is no NIfTI file");
    is_second_ = size == std::int32_t{kHeaderBytes2};
    if (is_second_ && bytes_.size() < kHeaderBytes2)
      return error("has " + std::to_string(bytes_.size()) + " bytes, a header has 540");
    const auto magic = bytes_.substr(is_second_ ? 4 : 344, 4);
    if (magic == std::string_view("ni1\0", 4) || magic == std::string_view("ni2\0", 4))
      return error("holds its image in another file: save both as one .nii");
    if (magic != std::string_view(is_second_ ? "n+2\0" : "n+1\0", 4))
      return error("magic is not n+1 or n+2: it is no NIfTI file");
    if (is_second_)
      read_second();
    else
      read_first();
    // A slope of 0 says that nothing is scaled, whatever scl_inter is.
    if (header_.slope != 0 && !(header_.slope == 1 && header_.inter == 0))
      return error("scl_slope and scl_inter scale the values: a label map has whole labels");
    return {};
  }

  template <typename Stored, typename Values>
  void take(std::size_t offset, Values& values) const {
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = at<Stored>(offset + i * sizeof(Stored));
  }

  void read_first() {
    take<std::int16_t>(40, header_.dim);
    header_.datatype = at<std::int16_t>(70);
    take<float>(76, header_.pixdim);
    header_.vox_offset = at<float>(108);
    header_.slope = at<float>(112);
    header_.inter = at<float>(116);
    header_.units = at<std::uint8_t>(123);
    header_.qform = at<std::int16_t>(252);
    header_.sform = at<std::int16_t>(254);
    take<float>(256, header_.quatern);
    take<float>(268, header_.qoffset);
    take<float>(280, header_.srow);
  }

  void read_second() {
    header_.datatype = at<std::int16_t>(12);
    take<std::int64_t>(16, header_.dim);
    take<double>(104, header_.pixdim);
    header_.vox_offset = static_cast<double>(at<std::int64_t>(168));
    header_.slope = at<double>(176);
    header_.inter = at<double>(184);
    header_.qform = at<std::int32_t>(344);
    header_.sform = at<std::int32_t>(348);
    take<double>(352, header_.quatern);
    take<double>(376, header_.qoffset);
    take<double>(400, header_.srow);
    header_.units = at<std::int32_t>(500);
  }

  Status read_size() {
    constexpr std::int64_t kMost = 32767;  // in a direction, as NIfTI-1 has at most
    const auto dimensions = header_.dim[0];
    if (dimensions < 3 || dimensions > 7)
      return error("dim[0] is " + std::to_string(dimensions) + ", must be 3");
    for (std::size_t d = 1; d <= static_cast<std::size_t>(dimensions); ++d) {
      const auto count = header_.dim[d];
      if (count < 1 || count > kMost || (d > 3 && count != 1))
        return error("dim[" + std::to_string(d) + "] is " + std::to_string(count) +
                     (d > 3 ? ", a label map has one volume" : ", must be 1 to 32767"));
      if (d <= 3) map_.size[d - 1] = static_cast<int>(count);
    }
    const auto code = header_.datatype;
    const auto type = std::ranges::find(kStoredTypes, code, &StoredType::code);
    if (type == std::end(kStoredTypes))
      return error("datatype " + std::to_string(code) + " is not read: save it as one of " +
                   stored_types());
    type_ = *type;
    const auto offset = header_.vox_offset;
    const double least = is_second_ ? double{kHeaderBytes2} : double{kHeaderBytes};
    if (!(offset >= least && offset <= 1e6) || offset != std::floor(offset))
      return error("vox_offset must be a whole number from the header's end to 1,000,000");
    begin_ = static_cast<std::size_t>(offset);
    count_ =
        std::uint64_t(map_.size[0]) * std::uint64_t(map_.size[1]) * std::uint64_t(map_.size[2]);
    const auto there = bytes_.size() > begin_ ? bytes_.size() - begin_ : 0;
    if (count_ > there / static_cast<std::uint64_t>(type_.bytes))
      return error("announces " + std::to_string(map_.size[0]) + " x " +
                   std::to_string(map_.size[1]) + " x " + std::to_string(map_.size[2]) +
                   " voxels, " + std::to_string(there / static_cast<std::size_t>(type_.bytes)) +
                   " follow: it is cut off");
    return {};
  }

  Status read_unit() {
    const auto units = header_.units & 7;
    if (units == 0) {
      scale_ = mesh::metres_of(unit_.value_or(mesh::Unit::Millimetre));
      if (!unit_)
        map_.warnings.push_back("xyzt_units says no unit of length, taken as mm (--unit)");
      return {};
    }
    if (units > 3) return error("xyzt_units " + std::to_string(units) + " is no unit of length");
    scale_ = units == 1 ? 1 : units == 2 ? 1e-3 : 1e-6;
    if (unit_ && mesh::metres_of(*unit_) != scale_)
      return error(std::string("xyzt_units says ") +
                   (units == 1   ? "m"
                    : units == 2 ? "mm"
                                 : "micrometres") +
                   ", --unit another: leave --unit out");
    return {};
  }

  // Columns of the matrix from voxels to the file's coordinates, and its last column.
  Status read_place() {
    std::array<Vec3d, 3> columns, of_qform;
    Vec3d origin;
    const auto sform = header_.sform, qform = header_.qform;
    const std::array<double, 3> sizes{header_.pixdim[1], header_.pixdim[2], header_.pixdim[3]};
    const auto turned = qform > 0 ? rotation(sizes, of_qform) : Status{};
    const auto& offset = header_.qoffset;
    const Vec3d origin_of_qform{offset[0], offset[1], offset[2]};
    if (sform > 0) {
      const auto row = [&](std::size_t r, std::size_t c) { return header_.srow[4 * r + c]; };
      for (std::size_t c = 0; c < 3; ++c) columns[c] = {row(0, c), row(1, c), row(2, c)};
      origin = {row(0, 3), row(1, 3), row(2, 3)};
    } else if (qform > 0) {
      if (!turned) return turned;
      columns = of_qform;
      origin = origin_of_qform;
    } else {
      columns = {Vec3d{sizes[0], 0, 0}, Vec3d{0, sizes[1], 0}, Vec3d{0, 0, sizes[2]}};
      map_.warnings.push_back(
          "has neither sform nor qform: which side is left is not known, taken as RAS");
    }
    if (auto s = place(origin, columns, map_); !s) return error(s.error().message);
    if (sform > 0 && qform > 0) compare(columns, origin, turned, of_qform, origin_of_qform);
    return {};
  }

  // From right, front, head to left, head, front.
  Status place(const Vec3d& origin, const std::array<Vec3d, 3>& columns, LabelMap& map) const {
    const auto turned = [&](const Vec3d& v) { return Vec3d{-v.x, v.z, v.y} * scale_; };
    return set_place(turned(origin), {turned(columns[0]), turned(columns[1]), turned(columns[2])},
                     map);
  }

  // Says where sform, which is taken, and qform differ by more than a tenth of a voxel.
  void compare(const std::array<Vec3d, 3>& columns, const Vec3d& origin, const Status& turned,
               const std::array<Vec3d, 3>& of_qform, const Vec3d& origin_of_qform) {
    LabelMap other;
    if (!turned || !place(origin_of_qform, of_qform, other)) {
      map_.warnings.push_back("sform and qform disagree: qform gives no position, sform was taken");
      return;
    }
    double farthest = 0;  // of the corners of the map
    for (int corner = 0; corner < 8; ++corner) {
      Vec3d apart = origin - origin_of_qform;
      for (std::size_t d = 0; d < 3; ++d)
        if (corner >> d & 1) apart += (columns[d] - of_qform[d]) * double(map_.size[d] - 1);
      farthest = std::max(farthest, length(apart));
    }
    constexpr double kTenth = 0.1;
    if (map_.orientation == other.orientation &&
        farthest <= kTenth * std::min({length(columns[0]), length(columns[1]), length(columns[2])}))
      return;
    map_.warnings.push_back(
        "sform and qform disagree" +
        (map_.orientation == other.orientation
             ? " by up to " + std::to_string(std::lround(1e3 * scale_ * farthest)) + " mm: "
             : " about the sides: sform says " + map_.orientation + ", qform " + other.orientation +
                   "; ") +
        "sform was taken");
  }

  Status rotation(const std::array<double, 3>& sizes, std::array<Vec3d, 3>& columns) const {
    const auto [b, c, d] = header_.quatern;
    const double rest = 1 - (b * b + c * c + d * d);
    if (!(rest > -1e-5)) return error("the quaternion of its qform is longer than 1");
    const double a = std::sqrt(std::max(rest, 0.0));
    // pixdim[0] is the sign of the third axis; 0 counts as 1.
    const double side = header_.pixdim[0] < 0 ? -1 : 1;
    columns = {
        Vec3d{a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c)} * sizes[0],
        Vec3d{2 * (b * c - a * d), a * a + c * c - b * b - d * d, 2 * (c * d + a * b)} * sizes[1],
        Vec3d{2 * (b * d + a * c), 2 * (c * d - a * b), a * a + d * d - c * c - b * b} *
            (sizes[2] * side)};
    return {};
  }

  double value(std::size_t i) const {
    const std::size_t offset = begin_ + i * static_cast<std::size_t>(type_.bytes);
    switch (type_.code) {
      case 2:
        return at<std::uint8_t>(offset);
      case 4:
        return at<std::int16_t>(offset);
      case 8:
        return at<std::int32_t>(offset);
      case 16:
        return at<float>(offset);
      case 64:
        return at<double>(offset);
      case 256:
        return at<std::int8_t>(offset);
      case 512:
        return at<std::uint16_t>(offset);
      case 768:
        return at<std::uint32_t>(offset);
      default:
        return static_cast<double>(at<std::int64_t>(offset));
    }
  }

  Status read_labels() {
    map_.labels.resize(count_);
    LabelCount labels;
    for (std::size_t i = 0; i < count_; ++i) {
      const double label = value(i);
      if (!(label >= 0 && label <= kMaxLabel && label == std::floor(label))) {
        const auto nx = static_cast<std::size_t>(map_.size[0]),
                   ny = static_cast<std::size_t>(map_.size[1]);
        return error("voxel (" + std::to_string(i % nx) + ", " + std::to_string(i / nx % ny) +
                     ", " + std::to_string(i / nx / ny) +
                     ") is no label: labels are whole numbers from 0 to 65535");
      }
      map_.labels[i] = static_cast<std::uint16_t>(label);
      if (!labels.add(map_.labels[i])) return error(LabelCount::error());
    }
    return {};
  }

  std::string_view bytes_;
  bool is_big_endian_ = false, is_second_ = false;
  Header header_;
  std::optional<mesh::Unit> unit_;
  const std::string& name_;
  StoredType type_{};
  std::size_t begin_ = 0;
  std::uint64_t count_ = 0;
  double scale_ = 1;  // metres in a unit of the file
  LabelMap map_;
};

}  // namespace

bool is_nifti_file(const std::filesystem::path& path) {
  const std::string name = path.string();
  return name.ends_with(".nii") || name.ends_with(".nii.gz");
}

Result<LabelMap> parse_nifti(std::string_view bytes, std::optional<mesh::Unit> unit,
                             const std::string& name) {
  if (!bytes.starts_with("\x1f\x8b")) return NiftiReader(bytes, unit, name).run();
  const auto unpacked = gunzip(bytes, name);
  if (!unpacked) return unpacked.error();
  return NiftiReader(*unpacked, unit, name).run();
}

Result<LabelMap> read_nifti(const std::filesystem::path& path, std::optional<mesh::Unit> unit) {
  const auto bytes = formats::read_foreign_file(path);
  if (!bytes) return bytes.error();
  return parse_nifti(*bytes, unit, path.string());
}

}  // namespace trocar::label_map
