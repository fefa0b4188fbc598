// libFuzzer on one decoder, the one that the environment variable TROCAR_DECODER names. Options and
// folders of seeds are libFuzzer's own; deploy/test and deploy/campaign fuzz run it.

#include <cstdio>
#include <cstdlib>

#include "tests/fuzz/decoders.h"

namespace {

const trocar::fuzz::Decoder* decoder = nullptr;

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  const char* name = std::getenv("TROCAR_DECODER");
  if (name) decoder = trocar::fuzz::find_decoder(name);
  if (decoder) return 0;
  std::fputs("fuzz: TROCAR_DECODER must name one of these decoders:", stderr);
  for (const auto& known : trocar::fuzz::decoders())
    std::fprintf(stderr, " %s", std::string(known.name).c_str());
  std::fputs("\n", stderr);
  std::exit(2);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  decoder->decode({data, size});
  return 0;
}
