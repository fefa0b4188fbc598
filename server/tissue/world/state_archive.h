#pragma once

// One walk over the state serves three ends: hashing it, writing it, and reading it back. Each
// stage has one function that names its arrays to an archive, so a snapshot holds exactly what the
// tick hash covers, and a field that is forgotten is forgotten by all three alike. (An array that
// changes rarely may be hashed when it does: the tick hash then covers its hash.)
//
// Reading treats the bytes as untrusted: sizes are checked before use, and after the first failure
// every later field reads as zero and `ok()` stays false.

#include <cstdint>
#include <type_traits>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/checksum.h"
#include "common/base/ids.h"
#include "common/base/index.h"
#include "common/math/frame.h"

namespace trocar::world {

// Types whose bytes are all value, no padding. Structs with padding are visited field by field.
template <typename T>
struct IsPaddingFree : std::bool_constant<std::is_arithmetic_v<T> || std::is_enum_v<T>> {};
template <typename T>
struct IsPaddingFree<Vec3<T>> : std::true_type {};
template <typename Tag>
struct IsPaddingFree<Index<Tag>> : std::true_type {};
template <>
struct IsPaddingFree<Quatf> : std::true_type {};
template <>
struct IsPaddingFree<Pose> : std::true_type {};
template <>
struct IsPaddingFree<ToolSlot> : std::true_type {};
template <>
struct IsPaddingFree<ParticipantSlot> : std::true_type {};
static_assert(sizeof(Vec3f) == 12 && sizeof(Quatf) == 16 && sizeof(Pose) == 28);

class StateArchive {
 public:
  static StateArchive hashing(StateHasher& hasher);
  static StateArchive writing(Bytes& out);
  static StateArchive reading(BytesView bytes);

  bool is_reading() const { return mode_ == Mode::Read; }
  bool is_hashing() const { return mode_ == Mode::Hash; }
  bool ok() const { return ok_; }
  bool at_end() const { return reader_.remaining() == 0; }
  // For checks beyond size and type, e.g. an index out of range.
  void fail() { ok_ = false; }

  template <typename T>
  void value(T& value) {
    static_assert(IsPaddingFree<T>::value);
    bytes({reinterpret_cast<std::uint8_t*>(&value), sizeof value});
  }
  // bool has one byte of which only 0 and 1 are valid.
  void flag(bool& value);
  // An array whose size both sides know.
  template <typename T>
  void fixed_array(std::vector<T>& values) {
    static_assert(IsPaddingFree<T>::value);
    bytes({reinterpret_cast<std::uint8_t*>(values.data()), values.size() * sizeof(T)});
  }
  // An array with its size in front; at most `limit` elements.
  template <typename T>
  void sized_array(std::vector<T>& values, std::uint32_t limit) {
    auto count = static_cast<std::uint32_t>(values.size());
    value(count);
    counted_array(values, count, limit);
  }
  // An array of `count` elements, a number that was visited before.
  template <typename T>
  void counted_array(std::vector<T>& values, std::uint32_t count, std::uint32_t limit) {
    if (is_reading()) {
      // Before memory is asked for: a few wrong bytes must not take gigabytes.
      if (count > limit || count * sizeof(T) > reader_.remaining()) fail();
      values.resize(ok_ ? count : 0);
    }
    fixed_array(values);
  }

 private:
  enum class Mode { Hash, Write, Read };
  StateArchive(Mode mode, StateHasher* hasher, Bytes* out, BytesView in)
      : mode_(mode), hasher_(hasher), out_(out), reader_(in) {}
  void bytes(std::span<std::uint8_t> data);

  Mode mode_;
  StateHasher* hasher_;
  Bytes* out_;
  ByteReader reader_;
  bool ok_ = true;
};

}  // namespace trocar::world
