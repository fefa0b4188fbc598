#pragma once

// Random bytes, hashes and comparison for secrets, all of OpenSSL. Nothing here is for checksums:
// those are in common/base.

#include <array>
#include <string>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace trocar::secure {

using Digest = std::array<std::uint8_t, 32>;

// Fills `bytes` from the operating system's generator; a machine without one ends the program.
void fill_random(std::span<std::uint8_t> bytes);
Digest sha256(BytesView bytes);
Digest hmac_sha256(BytesView key, BytesView bytes);
// Takes as long for equal bytes as for others; false if the sizes differ.
bool equal_in_constant_time(BytesView a, BytesView b);

std::string to_hex(BytesView bytes);
// Returns nothing (an empty array of bytes) if it is not hexadecimal.
Bytes from_hex(std::string_view text);

// Returns the newest entry of OpenSSL's queue of errors as words, and empties the queue.
std::string last_openssl_error();

}  // namespace trocar::secure
