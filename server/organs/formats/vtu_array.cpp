#include "server/organs/formats/vtu_array.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "common/base/inflate.h"
#include "server/organs/formats/text_reader.h"

namespace trocar::formats {
namespace {

Error bad(std::string what) {
  return {ErrorCode::BadFile, std::move(what)};
}

int value_of(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  return c == '+' ? 62 : c == '/' ? 63 : -1;
}

// Takes four characters at a time; padding may stand in the middle, where a header ends. Stops at
// `wanted` bytes, or at the end.
Result<std::string> decode_base64(std::string_view text, std::size_t wanted) {
  std::string out;
  std::uint32_t bits = 0;
  int taken = 0, padding = 0;
  for (const char c : text) {
    if (c == ' ' || c == '\n' || c == '\r' || c == '\t') continue;
    const int value = value_of(c);
    if (c == '=' ? taken < 2 : value < 0 || padding > 0)
      return bad("data hold " + shown(std::string_view(&c, 1)) + ", which is not base64");
    padding += c == '=';
    bits = bits << 6 | static_cast<std::uint32_t>(std::max(value, 0));
    if (++taken < 4) continue;
    for (int i = 0; i < 3 - padding; ++i) out += static_cast<char>(bits >> (16 - 8 * i) & 0xff);
    bits = 0, taken = 0, padding = 0;
    if (out.size() >= wanted) return out;
  }
  if (taken != 0) return bad("data end inside four characters of base64: they are cut off");
  return out;
}

// The number that begins at `bytes`.
template <typename T>
T number_at(const char* bytes, bool is_big_endian) {
  std::array<char, sizeof(T)> own{};
  std::copy_n(bytes, sizeof(T), own.begin());
  if (is_big_endian) std::ranges::reverse(own);
  return std::bit_cast<T>(own);
}

// Takes lengths from the front of decoded bytes.
struct Header {
  std::string_view bytes;
  const VtuSource& source;

  bool take(std::uint64_t& value) {
    const std::size_t size = source.has_wide_header ? 8 : 4;
    if (bytes.size() < size) return false;
    value = source.has_wide_header ? number_at<std::uint64_t>(bytes.data(), source.is_big_endian)
                                   : number_at<std::uint32_t>(bytes.data(), source.is_big_endian);
    bytes.remove_prefix(size);
    return true;
  }
};

// The bytes of the numbers, from decoded ones that begin with their lengths.
Result<std::string> unframe(const VtuSource& source, std::string_view framed) {
  Header header{framed, source};
  std::uint64_t length = 0;
  if (!source.is_packed) {
    if (!header.take(length)) return bad("data end before their length");
    if (length > header.bytes.size())
      return bad("data announce " + std::to_string(length) + " bytes, " +
                 std::to_string(header.bytes.size()) + " follow");
    return std::string(header.bytes.substr(0, length));
  }
  std::uint64_t blocks = 0, block_bytes = 0, last_bytes = 0;
  if (!header.take(blocks) || !header.take(block_bytes) || !header.take(last_bytes))
    return bad("data end before their lengths");
  if (blocks > header.bytes.size() / (source.has_wide_header ? 8 : 4))
    return bad("data announce " + std::to_string(blocks) + " blocks, there is no room for them");
  std::vector<std::uint64_t> sizes(blocks);
  for (auto& size : sizes) header.take(size);
  const std::size_t limit = source.file_bytes * 16 + (std::size_t{16} << 20);
  std::string out;
  for (const auto size : sizes) {
    if (size > header.bytes.size()) return bad("a packed block is cut off");
    if (auto s = inflate_into(header.bytes.substr(0, size), Packing::Zlib, limit, out); !s)
      return bad(out.size() > limit ? "data unpack to more than 16 times the file and 16 MiB"
                                    : s.error().message);
    header.bytes.remove_prefix(size);
  }
  const auto expected = blocks == 0 ? 0 : (blocks - (last_bytes != 0)) * block_bytes + last_bytes;
  if (out.size() != expected)
    return bad("data announce " + std::to_string(expected) + " bytes, " +
               std::to_string(out.size()) + " were packed");
  return out;
}

Result<std::string> bytes_of(const VtuSource& source) {
  constexpr auto kAll = std::numeric_limits<std::size_t>::max();
  if (source.format == "binary") {
    auto decoded = decode_base64(source.content, kAll);
    return decoded ? unframe(source, *decoded) : std::move(decoded);
  }
  if (source.format != "appended") return bad("format " + shown(source.format) + " is not known");
  if (source.offset < 0 || static_cast<std::size_t>(source.offset) >= source.appended.size())
    return bad("data begin at byte " + std::to_string(source.offset) + " of " +
               std::to_string(source.appended.size()) + " appended ones");
  const auto tail = source.appended.substr(static_cast<std::size_t>(source.offset));
  if (source.is_appended_raw) return unframe(source, tail);
  // Only its lengths say where this array's text ends: those are decoded first.
  const std::size_t width = source.has_wide_header ? 8 : 4;
  auto head = decode_base64(tail, width);
  if (!head) return head.error();
  Header header{*head, source};
  std::uint64_t first = 0;
  if (!header.take(first)) return bad("data end before their length");
  std::uint64_t wanted = width + first;
  if (source.is_packed) {
    if (first > tail.size()) return bad("data announce more blocks than there is room for");
    const auto header_bytes = width * (3 + first);
    auto sizes = decode_base64(tail, header_bytes);
    if (!sizes) return sizes.error();
    Header list{*sizes, source};
    std::uint64_t size = 0;
    wanted = header_bytes;
    for (std::uint64_t i = 0; i < 3 + first; ++i) {
      if (!list.take(size)) return bad("data end before their lengths");
      if (i >= 3) wanted += std::min<std::uint64_t>(size, tail.size());
    }
  }
  if (wanted > tail.size()) return bad("data are cut off");
  const auto decoded = decode_base64(tail, wanted);
  return decoded ? unframe(source, *decoded) : Result<std::string>(decoded.error());
}

template <typename Stored, typename Value>
Result<std::vector<Value>> convert(const VtuSource& source, const std::string& bytes) {
  if (bytes.size() % sizeof(Stored) != 0) return bad("data end inside a number");
  std::vector<Value> values(bytes.size() / sizeof(Stored));
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = static_cast<Value>(
        number_at<Stored>(bytes.data() + i * sizeof(Stored), source.is_big_endian));
  return values;
}

template <typename Value>
Result<std::vector<Value>> convert_wholes(const VtuSource& source, const std::string& bytes) {
  const auto type = source.type;
  if (type == "Int8") return convert<std::int8_t, Value>(source, bytes);
  if (type == "UInt8") return convert<std::uint8_t, Value>(source, bytes);
  if (type == "Int16") return convert<std::int16_t, Value>(source, bytes);
  if (type == "UInt16") return convert<std::uint16_t, Value>(source, bytes);
  if (type == "Int32") return convert<std::int32_t, Value>(source, bytes);
  if (type == "UInt32") return convert<std::uint32_t, Value>(source, bytes);
  if (type == "Int64" || type == "UInt64") return convert<std::int64_t, Value>(source, bytes);
  return bad("numbers of type " + shown(type) + " are not of the kind that is needed here");
}

// Words of text as numbers.
template <typename Value, typename Parse>
Result<std::vector<Value>> parse_words(std::string_view text, const Parse& parse) {
  TextReader words(text, "");
  std::vector<Value> values;
  for (auto word = words.token(); !word.empty(); word = words.token()) {
    Value value{};
    if (!parse(word, value)) return bad("number " + shown(word) + " cannot be read");
    values.push_back(value);
  }
  return values;
}

}  // namespace

Result<std::vector<double>> read_vtu_numbers(const VtuSource& source) {
  if (source.format == "ascii") return parse_words<double>(source.content, parse_finite);
  const auto bytes = bytes_of(source);
  if (!bytes) return bytes.error();
  auto values = source.type == "Float64"   ? convert<double, double>(source, *bytes)
                : source.type == "Float32" ? convert<float, double>(source, *bytes)
                                           : convert_wholes<double>(source, *bytes);
  if (values)
    for (std::size_t i = 0; i < values->size(); ++i)
      if (!std::isfinite((*values)[i]))
        return bad("number " + std::to_string(i) + " (from 0) is not finite");
  return values;
}

Result<std::vector<std::int64_t>> read_vtu_wholes(const VtuSource& source) {
  if (source.format == "ascii") return parse_words<std::int64_t>(source.content, parse_whole);
  const auto bytes = bytes_of(source);
  if (!bytes) return bytes.error();
  return convert_wholes<std::int64_t>(source, *bytes);
}

}  // namespace trocar::formats
