#pragma once

// A place to draw: a window (GLFW) or memory (EGL surfaceless and a framebuffer object, for
// --headless and tests, no display needed). Both make an OpenGL 3.3 core context current on the
// calling thread, which must be the render thread (for the window: the main thread).

#include <memory>
#include <string>
#include <vector>

#include "common/base/result.h"

struct GLFWwindow;

namespace trocar::render {

struct Size {
  int width = 0, height = 0;  // pixels of the framebuffer
};

struct Image {
  Size size;
  std::vector<std::uint8_t> rgb;  // rows from the top, 3 bytes per pixel
};

class GlContext {
 public:
  virtual ~GlContext() = default;

  // Handles window events; nothing when there is no window.
  virtual void poll_events() = 0;
  virtual Size size() const = 0;
  virtual bool should_close() const = 0;
  // Framebuffer object to draw the finished picture to.
  virtual unsigned framebuffer() const = 0;
  // Shows the picture (waits for the display's next refresh where there is one).
  virtual void present() = 0;
  // Null when there is no window.
  virtual GLFWwindow* window() { return nullptr; }

  // The name is "llvmpipe ..." and the like.
  std::string renderer_name() const;
  // True for Mesa's software rasterisers: then the scene is drawn with less.
  bool is_software() const;
  // The picture drawn since the last present(). Call before present().
  Image read_image() const;
};

// Error: no display (DISPLAY missing or refused), or no OpenGL 3.3.
Result<std::unique_ptr<GlContext>> make_window_context(Size size, const std::string& title);
Result<std::unique_ptr<GlContext>> make_headless_context(Size size);

Status write_png(const Image& image, const std::string& path);

}  // namespace trocar::render
