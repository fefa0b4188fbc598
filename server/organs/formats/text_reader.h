#pragma once

// A foreign file read line by line or word by word, with the line number for errors, and runs of
// bytes between lines for binary formats.
//
// Nothing is copied; views point into the text. Lines end with \n or \r\n. No memory is taken for a
// number in the file: check_count() compares an announced count with the bytes that are left.

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"

namespace trocar::formats {

class TextReader {
 public:
  // `name` stands for the file in errors. From `comment` on a line is skipped; 0: nowhere.
  TextReader(std::string_view text, std::string name, char comment = '\0')
      : text_(text), name_(std::move(name)), comment_(comment) {}

  const std::string& name() const { return name_; }
  std::string_view text() const { return text_; }
  int line_number() const { return line_number_; }
  // Makes errors speak of a line that was read before.
  void speak_of_line(int number) { line_number_ = number; }
  std::size_t remaining() const { return position_ < text_.size() ? text_.size() - position_ : 0; }

  // "name:line: what", or "name: byte N: what" once bytes were taken.
  Error error(const std::string& what) const;

  // Advances to the next line, without its end, outer blanks and comment; false at the end.
  bool next_line();
  // Advances to the next line that is not blank; false at the end.
  bool next_filled_line();
  // Error: the file ends inside `section`.
  Status need_line(std::string_view section);
  // The rest of the current line, behind the words taken from it.
  std::string_view line() const { return line_; }
  // Next word of the current line; empty when there is none.
  std::string_view word();
  // Next word of this or a later line; empty at the end of the file.
  std::string_view token();
  // The bytes behind the current line, whose rest is left out; empty if there are fewer.
  std::string_view bytes(std::size_t count);

  // A word of this or a later line as a number. Error: none, malformed, not finite.
  Status read_whole(std::string_view what, std::int64_t& value);
  Status read_number(std::string_view what, double& value);

  // Error: negative, or more elements than the rest of the file has room for at that least size.
  Status check_count(std::int64_t count, std::int64_t least_bytes, std::string_view what) const;

 private:
  std::string_view text_;
  std::string name_;
  char comment_;
  std::size_t position_ = 0;
  int line_number_ = 0;
  bool is_binary_ = false;
  std::string_view line_;
};

// Letters of ASCII made small.
std::string lower(std::string_view text);
// The text behind a byte order mark, if it begins with that of UTF-8.
std::string_view behind_mark(std::string_view text);
// A part of a foreign file made safe to print on one line, in quotation marks.
std::string shown(std::string_view text);
bool parse_whole(std::string_view text, std::int64_t& value);
// Only finite numbers; "1d5" as Fortran writes them is none.
bool parse_finite(std::string_view text, double& value);

// Numbers of nodes, which are sparse and in any order, to indices.
class NodeNumbers {
 public:
  // Error: a number is given twice.
  Status index(const std::vector<std::int64_t>& node_ids, const TextReader& reader);
  // -1: there is none.
  std::int64_t find(std::int64_t number) const;

 private:
  std::vector<std::pair<std::int64_t, std::int64_t>> by_number_;  // ascending
};

}  // namespace trocar::formats
