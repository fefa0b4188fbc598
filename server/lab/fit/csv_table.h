#pragma once

// CSV files as testing machines and spreadsheets write them: a header that names the columns, then
// rows of cells. What separates the header's cells, a comma, semicolon or tab, separates those of
// every row, except between quotation marks. Blanks and quotation marks around a cell are left out,
// and so are empty lines, lines that begin with # and a byte order mark. Other columns than those
// asked for do not count, but a row with more cells than the header is refused: so numbers with
// decimal commas are never taken for two. Error: the file, the line, what is wrong. One thread.

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace trocar::fit {

class CsvTable {
 public:
  struct Columns {
    std::vector<std::string> needed, optional;
  };
  static Result<CsvTable> read(const std::filesystem::path& path, const Columns& columns);
  // `source` stands for the file's name in messages.
  static Result<CsvTable> parse(std::string text, std::string source, const Columns& columns);

  bool has(std::string_view column) const;
  // Goes to the next row; false behind the last one.
  Result<bool> next();
  // Returns the row's number in a column; nothing unless the cell is one finite number with a
  // decimal point.
  std::optional<double> number(std::string_view column) const;
  // The text is empty without the column or cell.
  std::string_view text(std::string_view column) const;
  int line() const { return line_; }
  // Says what is wrong with the row or, behind the last one, with the file.
  Error wrong(const std::string& what) const;

 private:
  CsvTable() = default;
  bool next_cells();
  Status read_header(const Columns& columns);

  std::string text_, source_;
  std::size_t position_ = 0;  // of the next line in text_
  int line_ = 0;              // 0: of no line
  char separator_ = 0;        // 0: still unknown
  std::size_t column_count_ = 0;
  std::vector<std::pair<std::string, std::size_t>> columns_;  // those that are there
  std::vector<std::string_view> cells_;                       // of the row, in text_
};

// Nothing unless all of the text is one finite number.
std::optional<double> number_of(std::string_view text);
// Writes a cell that is read back as this text, in files separated by commas.
std::string csv_cell(std::string_view text);

}  // namespace trocar::fit
