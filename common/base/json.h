#pragma once

// JSON that programs write for scripts and people, with keys in the order in which they were set.

#include <cstdint>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <utility>

namespace trocar {

using Json = nlohmann::ordered_json;

// Returns the indented text with a line break at its end. A name from outside may hold bytes that
// are no UTF-8: they are replaced.
std::string to_text(const Json& json);

// Returns the whole number at a key. Throws std::out_of_range where there is another value, or one
// that T cannot hold: for those, get() of the library is undefined behaviour.
template <typename T, typename AnyJson>
T whole_number(const AnyJson& json, const char* key) {
  const AnyJson& value = json.at(key);
  if (value.is_number_unsigned()) {
    if (const auto number = value.template get<std::uint64_t>(); std::in_range<T>(number))
      return static_cast<T>(number);
  } else if (value.is_number_integer()) {
    if (const auto number = value.template get<std::int64_t>(); std::in_range<T>(number))
      return static_cast<T>(number);
  }
  throw std::out_of_range(std::string(key) + " is no whole number in its range");
}

// Returns hexadecimal digits, as hashes and checksums are written.
std::string hex32(std::uint32_t value);
std::string hex64(std::uint64_t value);

}  // namespace trocar
