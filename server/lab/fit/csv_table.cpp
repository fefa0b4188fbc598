#include "server/lab/fit/csv_table.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>

namespace trocar::fit {
namespace {

constexpr std::uintmax_t kLimitBytes = 64u << 20;
constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
constexpr std::string_view kSeparators = ",;\t", kAround = " \t\"\r";

// The first of these characters that is not between quotation marks, or the row's end.
std::size_t find_unquoted(std::string_view row, std::string_view characters) {
  bool is_quoted = false;
  for (std::size_t i = 0; i < row.size(); ++i) {
    if (row[i] == '"') is_quoted = !is_quoted;
    if (!is_quoted && characters.find(row[i]) != std::string_view::npos) return i;
  }
  return row.size();
}

std::string_view stripped(std::string_view cell) {
  const auto begin = cell.find_first_not_of(kAround);
  if (begin == std::string_view::npos) return {};
  return cell.substr(begin, cell.find_last_not_of(kAround) + 1 - begin);
}

// Writes names as "a, b and c".
std::string list_of(const std::vector<std::string>& names, const char* between, const char* last) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i)
    text += (i == 0 ? "" : i + 1 < names.size() ? between : last) + names[i];
  return text;
}

}  // namespace

Result<CsvTable> CsvTable::read(const std::filesystem::path& path, const Columns& columns) {
  const auto wrong = [&](const char* what) {
    return Error{ErrorCode::BadFile, path.string() + ": " + what};
  };
  std::error_code missing;
  const auto bytes = std::filesystem::file_size(path, missing);
  std::ifstream file(path, std::ios::binary);
  if (missing || !file) return wrong("cannot be opened, check name and rights");
  if (bytes > kLimitBytes) return wrong("is larger than 64 MiB, measured curves are not");
  std::string text(bytes, '\0');
  file.read(text.data(), static_cast<std::streamsize>(bytes));
  if (!file) return wrong("cannot be read");
  return parse(std::move(text), path.string(), columns);
}

Result<CsvTable> CsvTable::parse(std::string text, std::string source, const Columns& columns) {
  CsvTable table;
  table.text_ = std::move(text);
  table.source_ = std::move(source);
  if (table.text_.starts_with(kByteOrderMark)) table.position_ = kByteOrderMark.size();
  if (!table.next_cells()) return table.wrong("has no measurements");
  if (auto s = table.read_header(columns); !s) return s.error();
  table.cells_.clear();  // they are in the text as it lies here
  return table;
}

Status CsvTable::read_header(const Columns& columns) {
  column_count_ = cells_.size();
  for (const auto* names : {&columns.needed, &columns.optional})
    for (const auto& name : *names) {
      const auto found = std::find(cells_.begin(), cells_.end(), name);
      if (found == cells_.end()) continue;
      if (std::find(found + 1, cells_.end(), name) != cells_.end())
        return wrong("has two columns " + name + ", rename one");
      columns_.emplace_back(name, static_cast<std::size_t>(found - cells_.begin()));
    }
  for (const auto& name : columns.needed)
    if (!has(name))
      return wrong("is no header with the columns " + list_of(columns.needed, ", ", " and ") +
                   ", write \"" + list_of(columns.needed, ",", ",") + "\" above the numbers");
  return {};
}

// Reads the cells of the next line that has any.
bool CsvTable::next_cells() {
  while (position_ < text_.size()) {
    const auto end = std::min(text_.find('\n', position_), text_.size());
    std::string_view row(&text_[position_], end - position_);
    position_ = end + 1;
    ++line_;
    if (row.starts_with('#') || stripped(row).empty()) continue;
    if (separator_ == 0) {
      const auto at = find_unquoted(row, kSeparators);
      separator_ = at < row.size() ? row[at] : ',';
    }
    cells_.clear();
    for (;;) {
      const auto cell_end = find_unquoted(row, {&separator_, 1});
      cells_.push_back(stripped(row.substr(0, cell_end)));
      if (cell_end == row.size()) return true;
      row.remove_prefix(cell_end + 1);
    }
  }
  line_ = 0;
  return false;
}

Result<bool> CsvTable::next() {
  if (!next_cells()) return false;
  if (cells_.size() > column_count_)
    return wrong("has " + std::to_string(cells_.size()) + " cells under " +
                 std::to_string(column_count_) +
                 " columns: write numbers with a decimal point, and as many cells as columns");
  return true;
}

bool CsvTable::has(std::string_view column) const {
  return std::any_of(columns_.begin(), columns_.end(),
                     [&](const auto& known) { return known.first == column; });
}

std::string_view CsvTable::text(std::string_view column) const {
  for (const auto& [name, index] : columns_)
    if (name == column && index < cells_.size()) return cells_[index];
  return {};
}

std::optional<double> CsvTable::number(std::string_view column) const {
  return number_of(text(column));
}

Error CsvTable::wrong(const std::string& what) const {
  return {ErrorCode::BadFile,
          source_ + (line_ > 0 ? ":" + std::to_string(line_) : "") + ": " + what};
}

std::optional<double> number_of(std::string_view text) {
  // Machines write a plus before positive numbers, which from_chars does not know.
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  double value = 0;
  const auto [rest, failed] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (failed != std::errc{} || rest != text.data() + text.size() || !std::isfinite(value))
    return std::nullopt;
  return value;
}

std::string csv_cell(std::string_view text) {
  if (text.find_first_of(",;\t") == std::string_view::npos) return std::string(text);
  return "\"" + std::string(text) + "\"";
}

}  // namespace trocar::fit
