#pragma once

// The numbers of one DataArray of a VTK XML file: as text, as base64 or as appended bytes, packed
// by zlib or not.
//
// No memory is taken for a length in the file: packed blocks grow with what comes out of them, up
// to sixteen times the file and 16 MiB.
//
// Source: The VTK User's Guide, chapter "VTK File Formats"; the order of the sizes before packed
// blocks as the writer vtkXMLDataParser reads them.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace trocar::formats {

// Says where the numbers are and how they are written.
struct VtuSource {
  std::string_view type;      // "Float32", "Int64" and alike
  std::string_view format;    // "ascii", "binary" or "appended"
  std::string_view content;   // of the element
  std::int64_t offset = 0;    // into the appended data
  std::string_view appended;  // all of them, behind the underscore
  bool is_appended_raw = false;
  bool has_wide_header = false;  // lengths are of 64 bits, not 32
  bool is_packed = false;        // by zlib
  bool is_big_endian = false;    // of numbers and lengths
  std::size_t file_bytes = 0;    // size of the whole file
};

// Errors do not name the file. Numbers must be finite, and whole ones fit 64 bits.
Result<std::vector<double>> read_vtu_numbers(const VtuSource& source);
Result<std::vector<std::int64_t>> read_vtu_wholes(const VtuSource& source);

}  // namespace trocar::formats
