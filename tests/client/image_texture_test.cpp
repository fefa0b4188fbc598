// Pictures that a server sends: what is one becomes a texture, and all else an error.

#include "client/render/image_texture.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "client/render/gl_context.h"
#include "common/image/image.h"
#include "common/lesson/lesson_texts.h"
#include "tests/support/files.h"

namespace trocar::render {
namespace {

// A PNG file of one pixel, whose data unpack to `bytes` of zeros: one, and copies of the 258 before
// (RFC 1951, 3.2.6).
std::string png_that_unpacks_to(std::size_t bytes) {
  std::string data("\x78\x01", 2);
  unsigned kept = 0, bits = 0;
  const auto put = [&](const char* code) {
    for (; *code != 0; ++code) {
      kept |= static_cast<unsigned>(*code - '0') << bits;
      if (++bits < 8) continue;
      data += static_cast<char>(kept);
      kept = bits = 0;
    }
  };
  put("110");       // the last block, of fixed codes
  put("00110000");  // a byte of zero
  for (std::size_t made = 1; made < bytes; made += 258) put("1100010100000");
  put("000000000000000");  // its end
  std::string file("\x89PNG\r\n\x1a\n");
  const auto add = [&](const std::string& kind, const std::string& body) {
    for (int shift = 24; shift >= 0; shift -= 8) file += static_cast<char>(body.size() >> shift);
    file += kind + body + "sums";
  };
  add("IHDR", std::string("\0\0\0\1\0\0\0\1\x08\0\0\0\0", 13));
  add("IDAT", data);
  add("IEND", "");
  return file;
}

class ImageTextureTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto context = make_headless_context({64, 64});
    ASSERT_TRUE(context.ok()) << context.error().message;
    context_ = std::move(*context);
  }
  static std::string png_of(int width, int height) {
    const trocar::testing::TemporaryFolder folder;
    const auto file = folder.file("image.png");
    const auto bytes = static_cast<std::size_t>(3 * width * height);
    EXPECT_TRUE(write_png({{width, height}, std::vector<std::uint8_t>(bytes, 128)}, file));
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  std::unique_ptr<GlContext> context_;
};

TEST_F(ImageTextureTest, TakesPngAndTheJpegOfALesson) {
  ImageTexture texture;
  ASSERT_TRUE(texture.load(png_of(30, 20)));
  EXPECT_NE(texture.name(), 0u);
  EXPECT_EQ(texture.width(), 30);
  EXPECT_EQ(texture.height(), 20);
  ASSERT_FALSE(lesson::lesson_pictures().empty());
  for (const auto& picture : lesson::lesson_pictures())
    EXPECT_TRUE(texture.load(std::string(picture.bytes))) << picture.name;
  EXPECT_GT(texture.width(), 100);
}

TEST_F(ImageTextureTest, WhatIsNoPictureLeavesNone) {
  ImageTexture texture;
  const auto good = png_of(30, 20);
  ASSERT_TRUE(texture.load(good));
  for (const auto& bad : {std::string(), std::string("words"), good.substr(0, good.size() / 2),
                          std::string("\xff\xd8\xff\xe0 and no more")}) {
    EXPECT_FALSE(texture.load(bad));
    EXPECT_EQ(texture.name(), 0u);
    EXPECT_EQ(texture.width(), 0);
  }
}

TEST_F(ImageTextureTest, WhatIsTooLargeIsRefused) {
  ImageTexture texture;
  EXPECT_TRUE(texture.load(png_of(kMostImageSide, 1)));
  EXPECT_FALSE(texture.load(png_of(kMostImageSide + 1, 1)));
  EXPECT_EQ(texture.name(), 0u);
}

TEST_F(ImageTextureTest, WhatUnpacksToTooMuchIsRefused) {
  ImageTexture texture;
  const auto small = texture.load(png_that_unpacks_to(1000));
  EXPECT_TRUE(small) << small.error().message;
  EXPECT_FALSE(texture.load(png_that_unpacks_to(std::size_t{80} << 20)));
  EXPECT_EQ(texture.name(), 0u);
}

std::string a_jpeg() {
  for (const auto& picture : lesson::lesson_pictures())
    if (picture.bytes.starts_with("\xff\xd8")) return std::string(picture.bytes);
  ADD_FAILURE() << "no lesson has a JPEG";
  return {};
}

TEST_F(ImageTextureTest, JpegWithATableOfTooManyCodesIsRefused) {
  auto jpeg = a_jpeg();
  const auto table = jpeg.find("\xff\xc4");
  ASSERT_NE(table, std::string::npos);
  ImageTexture texture;
  EXPECT_TRUE(texture.load(jpeg));
  jpeg[table + 5 + 14] = jpeg[table + 5 + 15] = '\xff';  // of 15 and 16 bits
  const Status loaded = texture.load(jpeg);
  ASSERT_FALSE(loaded);
  EXPECT_EQ(loaded.error().message,
            "picture: a JPEG with a table of more than 256 codes, or too many tables");
}

// Whatever was in the memory before, a table that is not in the file is empty.
TEST(Image, ATableThatIsMissingIsEmpty) {
  std::ifstream in(
      std::string(TROCAR_SOURCE_DIR) + "/tests/fuzz/seeds/image/table_that_is_missing.jpg",
      std::ios::binary);
  const std::string file{std::istreambuf_iterator<char>(in), {}};
  const auto pixels_after = [&](char left) {
    std::vector<std::string> blocks;
    for (std::size_t bytes = 8000; bytes < 28'000; bytes += 500) blocks.emplace_back(bytes, left);
    blocks.clear();
    const auto image = image::decode(file);
    return image.ok() ? image->pixels : std::vector<image::Pixel>{};
  };
  const auto first = pixels_after('\0');
  for (const char left : {'\x55', '\xff', '\7'}) EXPECT_EQ(pixels_after(left), first);
}

TEST_F(ImageTextureTest, AnErrorIsOneLineWhateverTheFileSays) {
  auto png = png_of(2, 1);
  png.replace(png.find("IDAT"), 4, "I\nA\x1b");
  ImageTexture texture;
  const Status loaded = texture.load(png);
  ASSERT_FALSE(loaded);
  for (const char c : loaded.error().message) EXPECT_GE(c, ' ');
}

TEST_F(ImageTextureTest, JpegOfManyScansIsRefused) {
  const auto jpeg = a_jpeg();
  const auto scan = jpeg.find("\xff\xda"), end = jpeg.rfind("\xff\xd9");
  std::string many = jpeg.substr(0, end);
  for (int i = 0; i < 100; ++i) many += jpeg.substr(scan, end - scan);
  ImageTexture texture;
  // Bytes of 0xff may come before a marker (B.1.1.2), the first one too.
  for (const std::string before : {"", "\xff"}) {
    const Status loaded = texture.load(before + many + jpeg.substr(end));
    ASSERT_FALSE(loaded);
    EXPECT_NE(loaded.error().message.find("more than 100 scans"), std::string::npos);
  }
}

}  // namespace
}  // namespace trocar::render
