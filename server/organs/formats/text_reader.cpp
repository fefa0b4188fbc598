#include "server/organs/formats/text_reader.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>

#include "common/base/printable.h"

namespace trocar::formats {
namespace {

constexpr std::size_t kMaxShownBytes = 40;
constexpr const char* kBlanks = " \t\r\v\f";

template <typename T>
bool parse(std::string_view text, T& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size();
}

}  // namespace

std::string lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return out;
}

std::string_view behind_mark(std::string_view text) {
  constexpr std::string_view kMark = "\xef\xbb\xbf";
  return text.starts_with(kMark) ? text.substr(kMark.size()) : text;
}

std::string shown(std::string_view text) {
  return "'" + printable(text, kMaxShownBytes) + (text.size() > kMaxShownBytes ? "...'" : "'");
}

bool parse_whole(std::string_view text, std::int64_t& value) {
  return parse(text, value);
}

bool parse_finite(std::string_view text, double& value) {
  if (text.starts_with('+')) text.remove_prefix(1);
  return parse(text, value) && std::isfinite(value);
}

Error TextReader::error(const std::string& what) const {
  if (is_binary_)
    return {ErrorCode::BadFile,
            name_ + ": byte " + std::to_string(std::min(position_, text_.size())) + ": " + what};
  // Past the end: the last line had no line end.
  const char* hint = position_ > text_.size() ? " (the file ends here: it may be cut off)" : "";
  return {ErrorCode::BadFile, name_ + ":" + std::to_string(line_number_) + ": " + what + hint};
}

bool TextReader::next_line() {
  if (position_ >= text_.size()) {
    line_ = {};
    return false;
  }
  const auto end = std::min(text_.find('\n', position_), text_.size());
  line_ = text_.substr(position_, end - position_);
  position_ = end + 1;
  ++line_number_;
  if (comment_ != '\0') line_ = line_.substr(0, line_.find(comment_));
  const auto first = line_.find_first_not_of(kBlanks);
  line_ = first == std::string_view::npos ? std::string_view{} : line_.substr(first);
  line_ = line_.substr(0, line_.find_last_not_of(kBlanks) + 1);
  return true;
}

bool TextReader::next_filled_line() {
  while (next_line())
    if (!line_.empty()) return true;
  return false;
}

Status TextReader::need_line(std::string_view section) {
  if (next_filled_line()) return {};
  return error("the file ends inside " + std::string(section) + ": it is cut off, fetch it again");
}

std::string_view TextReader::word() {
  const auto begin = std::min(line_.find_first_not_of(kBlanks), line_.size());
  const auto end = std::min(line_.find_first_of(kBlanks, begin), line_.size());
  const auto found = line_.substr(begin, end - begin);
  line_ = line_.substr(end);
  return found;
}

std::string_view TextReader::token() {
  while (true) {
    if (const auto found = word(); !found.empty()) return found;
    if (!next_line()) return {};
  }
}

std::string_view TextReader::bytes(std::size_t count) {
  if (count > remaining()) return {};
  is_binary_ = true;
  line_ = {};
  const auto found = text_.substr(position_, count);
  position_ += count;
  return found;
}

Status TextReader::read_whole(std::string_view what, std::int64_t& value) {
  const auto text = token();
  if (parse(text, value)) return {};
  if (text.empty()) return error("the file ends before " + std::string(what) + ": it is cut off");
  return error(std::string(what) + " is " + shown(text) + ", must be a whole number");
}

Status TextReader::read_number(std::string_view what, double& value) {
  const auto text = token();
  if (parse_finite(text, value)) return {};
  if (text.empty()) return error("the file ends before " + std::string(what) + ": it is cut off");
  return error(std::string(what) + " " + shown(text) + " is not a finite number" +
               (text.find(',') != text.npos ? ": write decimals with a point" : ""));
}

Status TextReader::check_count(std::int64_t count, std::int64_t least_bytes,
                               std::string_view what) const {
  const std::string announced =
      "announces " + std::to_string(count) + " " + std::string(what) + ", ";
  if (count < 0) return error(announced + "must be 0 or more: write the true number");
  const auto room = static_cast<std::int64_t>(remaining() + line_.size()) / least_bytes + 1;
  if (count > room)
    return error(announced + "the rest of the file has room for at most " + std::to_string(room));
  return {};
}

Status NodeNumbers::index(const std::vector<std::int64_t>& node_ids, const TextReader& reader) {
  by_number_.resize(node_ids.size());
  for (std::size_t i = 0; i < by_number_.size(); ++i)
    by_number_[i] = {node_ids[i], static_cast<std::int64_t>(i)};
  std::sort(by_number_.begin(), by_number_.end());
  for (std::size_t i = 1; i < by_number_.size(); ++i)
    if (by_number_[i].first == by_number_[i - 1].first)
      return reader.error("node number " + std::to_string(by_number_[i].first) +
                          " is given twice: number every node differently");
  return {};
}

std::int64_t NodeNumbers::find(std::int64_t number) const {
  const auto found =
      std::lower_bound(by_number_.begin(), by_number_.end(), std::pair(number, std::int64_t{0}));
  return found == by_number_.end() || found->first != number ? -1 : found->second;
}

}  // namespace trocar::formats
