#pragma once

// Little-endian reading and writing of plain bytes. The reader never reads past its end: the first
// failed read makes `ok()` false and every later one return zero, so a parser checks once.

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

namespace trocar {

static_assert(std::endian::native == std::endian::little, "state arrays are stored as they lie");

using Bytes = std::vector<std::uint8_t>;
using BytesView = std::span<const std::uint8_t>;

template <typename T>
concept PlainNumber = std::is_arithmetic_v<T> || std::is_enum_v<T>;

// View of any array of padding-free elements as bytes.
template <typename T>
BytesView bytes_of(std::span<const T> values) {
  static_assert(std::is_trivially_copyable_v<T>);
  return {reinterpret_cast<const std::uint8_t*>(values.data()), values.size_bytes()};
}
template <typename T>
BytesView bytes_of(const std::vector<T>& values) {
  return bytes_of(std::span<const T>(values));
}
inline BytesView bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

class ByteWriter {
 public:
  explicit ByteWriter(Bytes& out) : out_(out) {}

  template <PlainNumber T>
  void put(T value) {
    const auto at = out_.size();
    out_.resize(at + sizeof value);
    std::memcpy(out_.data() + at, &value, sizeof value);
  }
  void put_bytes(BytesView bytes) { out_.insert(out_.end(), bytes.begin(), bytes.end()); }
  // u32 byte length, then the bytes (MCAP's String).
  void put_string(std::string_view text) {
    put(static_cast<std::uint32_t>(text.size()));
    put_bytes(bytes_of(text));
  }

 private:
  Bytes& out_;
};

class ByteReader {
 public:
  explicit ByteReader(BytesView bytes) : bytes_(bytes) {}

  bool ok() const { return ok_; }
  std::size_t position() const { return position_; }
  std::size_t remaining() const { return bytes_.size() - position_; }

  template <PlainNumber T>
  T read() {
    T value{};
    if (const auto bytes = read_bytes(sizeof(T)); ok_) std::memcpy(&value, bytes.data(), sizeof(T));
    return value;
  }
  BytesView read_bytes(std::uint64_t count) {
    if (!ok_ || count > remaining()) {
      ok_ = false;
      return {};
    }
    const auto view = bytes_.subspan(position_, static_cast<std::size_t>(count));
    position_ += view.size();
    return view;
  }
  std::string_view read_string() {
    const auto bytes = read_bytes(read<std::uint32_t>());
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }

 private:
  BytesView bytes_;
  std::size_t position_ = 0;
  bool ok_ = true;
};

}  // namespace trocar
