#pragma once

// JSON that programs write for scripts and people, with keys in the order in which they were set.

#include <nlohmann/json.hpp>
#include <string>

namespace trocar {

using Json = nlohmann::ordered_json;

// Returns the indented text with a line break at its end. A name from outside may hold bytes that
// are no UTF-8: they are replaced.
std::string to_text(const Json& json);

// Returns hexadecimal digits, as hashes and checksums are written.
std::string hex32(std::uint32_t value);
std::string hex64(std::uint64_t value);

}  // namespace trocar
