// Pictures from the bytes of files: what is one comes back as it was, and all else is an error.

#include "common/image/image.h"

#include <gtest/gtest.h>
#include <turbojpeg.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

namespace trocar::image {
namespace {

// Colours that change slowly, as a JPEG keeps them.
std::vector<std::uint8_t> slope(int width, int height, int channels) {
  std::vector<std::uint8_t> values;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < channels; ++c)
        values.push_back(static_cast<std::uint8_t>(40 + 2 * x + y + 20 * c));
  return values;
}

std::string jpeg_of(int width, int height, TJPF format = TJPF_RGB, int flags = 0) {
  const std::unique_ptr<void, int (*)(tjhandle)> writer(tjInitCompress(), tjDestroy);
  const auto values = slope(width, height, tjPixelSize[format]);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  const auto subsampling = format == TJPF_GRAY ? TJSAMP_GRAY : TJSAMP_420;
  EXPECT_EQ(tjCompress2(writer.get(), values.data(), width, 0, height, format, &bytes, &size,
                        subsampling, 95, flags),
            0)
      << tjGetErrorStr2(writer.get());
  std::string file(reinterpret_cast<const char*>(bytes), size);
  tjFree(bytes);
  return file;
}

std::string png_of(int width, int height) {
  auto file = encode_png(width, height, slope(width, height, 3));
  EXPECT_TRUE(file.ok());
  return file.ok() ? *file : std::string();
}

std::string error_of(const std::string& file) {
  const auto image = decode(file);
  return image.ok() ? std::string() : image.error().message;
}

TEST(Image, PngKeepsEachPixel) {
  const auto image = decode(png_of(31, 17));
  ASSERT_TRUE(image.ok()) << image.error().message;
  ASSERT_EQ(image->width, 31);
  ASSERT_EQ(image->height, 17);
  const auto rgb = slope(31, 17, 3);
  for (std::size_t i = 0; i < image->pixels.size(); ++i)
    EXPECT_EQ(image->pixels[i], (Pixel{rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2], 255}));
}

TEST(Image, JpegKeepsColoursAndGreysToWhatItsQualityAllows) {
  for (const auto format : {TJPF_RGB, TJPF_GRAY})
    for (const int flags : {0, TJFLAG_PROGRESSIVE}) {
      const auto image = decode(jpeg_of(40, 24, format, flags));
      ASSERT_TRUE(image.ok()) << image.error().message;
      const int channels = tjPixelSize[format];
      const auto values = slope(40, 24, channels);
      int worst = 0;
      for (std::size_t i = 0; i < image->pixels.size(); ++i)
        for (std::size_t c = 0; c < 3; ++c)
          worst = std::max(
              worst,
              std::abs(image->pixels[i][c] -
                       values[i * static_cast<std::size_t>(channels) + (channels == 1 ? 0 : c)]));
      EXPECT_LE(worst, 8);
      EXPECT_EQ(image->at(39, 23)[3], 255);
    }
}

TEST(Image, WhatIsCutShortAnywhereIsRefused) {
  for (const auto& file :
       {png_of(31, 17), jpeg_of(40, 24), jpeg_of(40, 24, TJPF_RGB, TJFLAG_PROGRESSIVE)}) {
    // A reader needs no more than the last pixel's data: what ends a file may be missing.
    const std::size_t needed = file.size() - 16;
    for (std::size_t size = 0; size < needed; ++size)
      ASSERT_NE(error_of(file.substr(0, size)), "") << size << " of " << file.size();
  }
}

TEST(Image, WhatIsDamagedIsOneLineOfError) {
  EXPECT_EQ(error_of(""), "picture: neither PNG nor JPEG");
  EXPECT_EQ(error_of("words"), "picture: neither PNG nor JPEG");
  auto png = png_of(2, 1);
  png.replace(png.find("IDAT"), 4, "I\nA\x1b");
  const auto error = error_of(png);
  EXPECT_TRUE(error.starts_with("picture: "));
  for (const char c : error) EXPECT_GE(c, ' ');
}

TEST(Image, TheLargestSideIsABound) {
  EXPECT_EQ(error_of(png_of(kMostSide, 1)), "");
  EXPECT_EQ(error_of(jpeg_of(1, kMostSide)), "");
  EXPECT_EQ(error_of(png_of(kMostSide + 1, 1)),
            "picture: 2049 x 1 pixels, at most 2048 along a side");
  EXPECT_EQ(error_of(jpeg_of(1, kMostSide + 1)),
            "picture: 1 x 2049 pixels, at most 2048 along a side");
}

TEST(Image, JpegForPrintIsRefused) {
  EXPECT_EQ(error_of(jpeg_of(16, 16, TJPF_CMYK)),
            "picture: a JPEG in CMYK, for print; save it in RGB");
}

// Each scan goes over the whole picture, however few bytes it has. One that says again what another
// has said is found before the library counts 500.
TEST(Image, JpegThatRepeatsItsScansIsRefused) {
  const auto file = jpeg_of(40, 24, TJPF_RGB, TJFLAG_PROGRESSIVE);
  const auto last = file.rfind("\xff\xda");
  const auto scan = file.substr(last, file.size() - 2 - last);
  auto longer = file.substr(0, last);
  for (int i = 0; i < 5000; ++i) longer += scan;
  const auto error = error_of(longer + "\xff\xd9");
  EXPECT_TRUE(error.starts_with("picture: Inconsistent progression sequence")) << error;
}

}  // namespace
}  // namespace trocar::image
