#include "common/base/bytes.h"

#include <gtest/gtest.h>

#include <limits>

namespace trocar {
namespace {

enum class Colour : std::uint16_t { Blue = 0x0102 };

TEST(Bytes, WritesLittleEndianAndReadsBackWhatWasWritten) {
  Bytes bytes;
  ByteWriter writer(bytes);
  writer.put(std::uint32_t{0x01020304});
  writer.put(Colour::Blue);
  writer.put(-1.5f);
  writer.put_string("ab");
  EXPECT_EQ(bytes, (Bytes{4, 3, 2, 1, 2, 1, 0, 0, 0xc0, 0xbf, 2, 0, 0, 0, 'a', 'b'}));

  ByteReader reader(bytes);
  EXPECT_EQ(reader.read<std::uint32_t>(), 0x01020304u);
  EXPECT_EQ(reader.read<Colour>(), Colour::Blue);
  EXPECT_EQ(reader.read<float>(), -1.5f);
  EXPECT_EQ(reader.read_string(), "ab");
  EXPECT_TRUE(reader.ok());
  EXPECT_EQ(reader.remaining(), 0u);
}

TEST(Bytes, AReadPastTheEndFailsAndEveryLaterOneToo) {
  const Bytes bytes{1, 2, 3};
  ByteReader reader(bytes);
  EXPECT_EQ(reader.read<std::uint32_t>(), 0u);
  EXPECT_FALSE(reader.ok());
  EXPECT_EQ(reader.read<std::uint8_t>(), 0u) << "although one byte would fit";
  EXPECT_FALSE(reader.ok());
}

TEST(Bytes, ALengthLargerThanTheRestIsRefusedWithoutReadingIt) {
  Bytes bytes;
  ByteWriter(bytes).put(std::numeric_limits<std::uint32_t>::max());
  bytes.push_back('x');
  ByteReader strings(bytes);
  EXPECT_EQ(strings.read_string(), "");
  EXPECT_FALSE(strings.ok());
  ByteReader raw(bytes);
  EXPECT_TRUE(raw.read_bytes(std::numeric_limits<std::uint64_t>::max()).empty());
  EXPECT_FALSE(raw.ok());
}

TEST(Bytes, TruncationAtEveryLengthIsSeen) {
  Bytes bytes;
  ByteWriter writer(bytes);
  writer.put(std::uint64_t{7});
  writer.put_string("trocar");
  writer.put(std::uint16_t{9});
  for (std::size_t length = 0; length <= bytes.size(); ++length) {
    ByteReader reader(BytesView(bytes).first(length));
    reader.read<std::uint64_t>();
    reader.read_string();
    reader.read<std::uint16_t>();
    EXPECT_EQ(reader.ok(), length == bytes.size()) << length;
  }
}

TEST(Bytes, AnEmptyTakeSucceedsAtTheEnd) {
  ByteReader reader(BytesView{});
  EXPECT_TRUE(reader.read_bytes(0).empty());
  EXPECT_TRUE(reader.ok());
}

}  // namespace
}  // namespace trocar
