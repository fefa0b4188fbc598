// Writes journals for the independent reader: write_sample_journals FOLDER. The folder must be
// empty.
//   finished.mcap    4 s, closed
//   killed.mcap      the same without its end
//   repaired.mcap    made of that
//   one_each.mcap    one message per chunk, one larger than any chunk
//   empty.mcap       nothing but a frame

#include <cstdio>
#include <string>

#include "common/journal/mcap_repair.h"
#include "tests/journal/session_samples.h"

namespace {

using namespace trocar;           // NOLINT: a program's own file
using namespace trocar::journal;  // NOLINT

void require(const Status& status) {
  if (!status.ok())
    std::fprintf(stderr, "write_sample_journals: %s\n", status.error().message.c_str());
  TROCAR_ASSERT(status.ok());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "write_sample_journals: usage: write_sample_journals FOLDER\n");
    return 2;
  }
  const std::string folder = std::string(argv[1]) + "/";
  {
    journal::testing::SampleSession session(folder + "finished.mcap");
    session.run(251);
    require(session.writer().close());
  }
  {
    journal::testing::SampleSession session(folder + "killed.mcap");
    session.run(251);
  }
  TROCAR_ASSERT(repair(folder + "killed.mcap", folder + "repaired.mcap").ok());
  auto one_each = McapWriter::create(folder + "one_each.mcap", {"", "trocar tests"});
  TROCAR_ASSERT(one_each.ok());
  const auto channel = (*one_each)->add_channel("/big", "", 0);
  for (std::uint64_t i = 0; i < 5; ++i) {
    const Bytes data(i == 3 ? 2'000'000 : 100'000, static_cast<std::uint8_t>(i));
    require((*one_each)->write(channel, 1'000'000'000 + i, 1, data));
  }
  require((*one_each)->close());
  auto empty = McapWriter::create(folder + "empty.mcap", {"", "trocar tests"});
  TROCAR_ASSERT(empty.ok());
  require((*empty)->close());
  return 0;
}
