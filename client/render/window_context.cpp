#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <cstdlib>

#include "client/render/gl.h"
#include "client/render/gl_context.h"

namespace trocar::render {
namespace {

class WindowContext final : public GlContext {
 public:
  explicit WindowContext(GLFWwindow* window) : window_(window) {}
  ~WindowContext() override {
    glfwDestroyWindow(window_);
    glfwTerminate();
  }
  void poll_events() override { glfwPollEvents(); }
  Size size() const override {
    Size size;
    glfwGetFramebufferSize(window_, &size.width, &size.height);
    return size;
  }
  bool should_close() const override { return glfwWindowShouldClose(window_) != 0; }
  unsigned framebuffer() const override { return 0; }
  void present() override { glfwSwapBuffers(window_); }
  GLFWwindow* window() override { return window_; }

 private:
  GLFWwindow* window_;
};

std::string last_glfw_error() {
  const char* text = nullptr;
  glfwGetError(&text);
  return text != nullptr ? text : "no reason given";
}

}  // namespace

Result<std::unique_ptr<GlContext>> make_window_context(Size size, const std::string& title) {
  if (glfwInit() == GLFW_FALSE)
    return Error{ErrorCode::ResourceMissing,
                 "no display for a window (" + last_glfw_error() +
                     "): start it in a desktop session, or use --headless"};
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
  glfwWindowHint(GLFW_DEPTH_BITS, 0);  // the scene has buffers of its own
  GLFWwindow* window = glfwCreateWindow(size.width, size.height, title.c_str(), nullptr, nullptr);
  if (window == nullptr) {
    const std::string reason = last_glfw_error();
    glfwTerminate();
    return Error{ErrorCode::ResourceMissing,
                 "no window with OpenGL 3.3 (" + reason + "): install a driver, or use --headless"};
  }
  glfwMakeContextCurrent(window);
  glfwSwapInterval(1);
  return std::unique_ptr<GlContext>(std::make_unique<WindowContext>(window));
}

}  // namespace trocar::render
