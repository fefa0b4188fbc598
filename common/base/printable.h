#pragma once

// Text from outside that people will see, in a terminal, a window or a log: what it shows must be
// what it is, and it must not give orders to a terminal.

#include <cstdint>
#include <string>
#include <string_view>

namespace trocar {

// Length in bytes of the code point at the front of `text`, and its value; 0 if it is not UTF-8
// (truncated, overlong, surrogate or above U+10FFFF). `text` is not empty.
std::size_t decode_code_point(std::string_view text, std::uint32_t& code_point);

// False for control and invisible characters, and for those that reorder the text around them.
bool is_printable(std::uint32_t code_point);
// False also where it is not UTF-8.
bool is_printable(std::string_view text);

// The text with a question mark for each character that cannot be printed, at most `limit` bytes.
std::string printable(std::string_view text, std::size_t limit = 1000);

// A name from outside as one of ours: printable UTF-8 of at most `limit` bytes. Bytes that are no
// UTF-8 are taken for Latin-1, and what cannot be printed becomes an underscore.
std::string as_name(std::string_view text, std::size_t limit);

}  // namespace trocar
