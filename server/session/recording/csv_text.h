#pragma once

#include <string>

#include "common/base/printable.h"

namespace trocar::recording {

// Makes a cell of a table (CSV): printable, in quotation marks, and no formula to a spreadsheet
// program, which takes it for text by the apostrophe.
inline std::string csv_text(const std::string& text) {
  std::string out = "\"";
  if (text.find_first_of("=+-@") == 0) out += '\'';
  for (const char c : printable(text)) {
    if (c == '"') out += '"';
    out += c;
  }
  return out + '"';
}

}  // namespace trocar::recording
