#pragma once

// A picture from a file's bytes as a texture. Render thread, with its context current.

#include <string>

#include "common/base/result.h"

namespace trocar::render {

inline constexpr int kMostImageSide = 2048;  // pixels

class ImageTexture {
 public:
  ImageTexture() = default;
  ~ImageTexture() { clear(); }
  ImageTexture(const ImageTexture&) = delete;
  ImageTexture& operator=(const ImageTexture&) = delete;

  // A PNG or JPEG file. Error, and then there is no picture: image::decode() refuses it.
  Status load(const std::string& bytes);
  void clear();

  unsigned name() const { return name_; }  // 0: there is no picture
  int width() const { return width_; }     // pixels
  int height() const { return height_; }

 private:
  unsigned name_ = 0;
  int width_ = 0, height_ = 0;
};

}  // namespace trocar::render
