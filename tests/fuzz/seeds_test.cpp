// The committed seeds through their decoders: each decoder accepts one at least, so that a fuzzer
// starts from something sound, and whatever once broke a decoder is among them.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "tests/fuzz/decoders.h"

namespace trocar::fuzz {
namespace {

namespace fs = std::filesystem;

const fs::path kSeeds = fs::path(TROCAR_SOURCE_DIR) / "tests/fuzz/seeds";

TEST(FuzzSeeds, EachDecoderReadsItsSeedsAndAcceptsOne) {
  for (const auto& decoder : decoders()) {
    int accepted = 0;
    for (const auto& entry : fs::directory_iterator(kSeeds / decoder.name)) {
      SCOPED_TRACE(entry.path().string());
      std::ifstream file(entry.path(), std::ios::binary);
      const std::string text{std::istreambuf_iterator<char>(file), {}};
      accepted += decoder.decode(bytes_of(std::string_view(text))) ? 1 : 0;
      // Cut off anywhere, it is refused or read, but nothing breaks.
      for (std::size_t size = 0; size < text.size(); size += 1 + text.size() / 50)
        decoder.decode(bytes_of(std::string_view(text).substr(0, size)));
    }
    EXPECT_GT(accepted, 0) << decoder.name;
  }
}

TEST(FuzzSeeds, AllBelongToADecoder) {
  for (const auto& entry : fs::directory_iterator(kSeeds))
    EXPECT_NE(find_decoder(entry.path().filename().string()), nullptr) << entry.path();
}

}  // namespace
}  // namespace trocar::fuzz
