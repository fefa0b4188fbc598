#include "common/image/image.h"

#include <png.h>
#include <turbojpeg.h>

#include <memory>
#include <optional>

#include "common/base/assert.h"
#include "common/base/printable.h"

namespace trocar::image {
namespace {

// The words of a library may hold bytes of the file, such as the name of a chunk.
Error bad(std::string_view why) {
  return Error{ErrorCode::BadFile, "picture: " + printable(why, 80)};
}

std::optional<Error> wrong_size(std::int64_t width, std::int64_t height) {
  if (width >= 1 && height >= 1 && width <= kMostSide && height <= kMostSide) return {};
  return bad(std::to_string(width) + " x " + std::to_string(height) + " pixels, at most " +
             std::to_string(kMostSide) + " along a side");
}

Image blank(int width, int height) {
  return {width, height,
          std::vector<Pixel>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height))};
}

Result<Image> decode_png(std::string_view file) {
  png_image header{};
  header.version = PNG_IMAGE_VERSION;
  const std::unique_ptr<png_image, void (*)(png_image*)> freed(&header, png_image_free);
  if (png_image_begin_read_from_memory(&header, file.data(), file.size()) == 0)
    return bad(header.message);
  if (auto wrong = wrong_size(header.width, header.height)) return *wrong;
  header.format = PNG_FORMAT_RGBA;
  header.flags |= PNG_IMAGE_FLAG_16BIT_sRGB;
  auto image = blank(static_cast<int>(header.width), static_cast<int>(header.height));
  if (png_image_finish_read(&header, nullptr, image.pixels.data(), 0, nullptr) == 0)
    return bad(header.message);
  return image;
}

Result<Image> decode_jpeg(std::string_view file) {
  const std::unique_ptr<void, int (*)(tjhandle)> reader(tjInitDecompress(), tjDestroy);
  if (!reader) return bad("no memory for it");
  const auto* bytes = reinterpret_cast<const unsigned char*>(file.data());
  int width = 0, height = 0, subsampling = 0, colours = 0;
  if (tjDecompressHeader3(reader.get(), bytes, file.size(), &width, &height, &subsampling,
                          &colours) != 0)
    return bad(tjGetErrorStr2(reader.get()));
  if (auto wrong = wrong_size(width, height)) return *wrong;
  if (colours == TJCS_CMYK || colours == TJCS_YCCK)
    return bad("a JPEG in CMYK, for print; save it in RGB");
  auto image = blank(width, height);
  if (tjDecompress2(reader.get(), bytes, file.size(), image.pixels.data()->data(), width, 0, height,
                    TJPF_RGBA, TJFLAG_LIMITSCANS | TJFLAG_STOPONWARNING) != 0)
    return bad(tjGetErrorStr2(reader.get()));
  return image;
}

}  // namespace

Result<Image> decode(std::string_view file) {
  if (file.size() > kMostFileBytes) return bad("a file of more than 64 MiB");
  if (file.starts_with("\x89PNG")) return decode_png(file);
  if (file.starts_with("\xff\xd8")) return decode_jpeg(file);
  return bad("neither PNG nor JPEG");
}

Result<std::string> encode_png(int width, int height, std::span<const std::uint8_t> rgb) {
  TROCAR_ASSERT(width >= 1 && height >= 1 &&
                rgb.size() ==
                    3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  png_image header{};
  header.version = PNG_IMAGE_VERSION;
  header.width = static_cast<png_uint_32>(width);
  header.height = static_cast<png_uint_32>(height);
  header.format = PNG_FORMAT_RGB;
  png_alloc_size_t bytes = PNG_IMAGE_PNG_SIZE_MAX(header);
  std::string file(bytes, '\0');
  if (png_image_write_to_memory(&header, file.data(), &bytes, 0, rgb.data(), 0, nullptr) == 0)
    return bad(header.message);
  file.resize(bytes);
  return file;
}

}  // namespace trocar::image
