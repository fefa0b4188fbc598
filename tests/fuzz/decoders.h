#pragma once

// Every decoder of outside data as one function of bytes, for libFuzzer (fuzz.cpp) and for the test
// that reads the committed seeds (seeds_test.cpp).

#include <span>
#include <string_view>

#include "common/base/bytes.h"

namespace trocar::fuzz {

struct Decoder {
  std::string_view name;  // also the folder in tests/fuzz/seeds
  // True: accepted. Any bytes are allowed; a broken promise of the decoder aborts.
  bool (*decode)(BytesView bytes);
};

std::span<const Decoder> decoders();
// Null: there is none of that name.
const Decoder* find_decoder(std::string_view name);

}  // namespace trocar::fuzz
