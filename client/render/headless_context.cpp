#include <EGL/egl.h>
#include <EGL/eglext.h>

#include "client/render/gl.h"
#include "client/render/gl_context.h"

namespace trocar::render {
namespace {

class HeadlessContext final : public GlContext {
 public:
  HeadlessContext(EGLDisplay display, EGLContext context, Size size)
      : display_(display), context_(context), size_(size) {
    glGenRenderbuffers(1, &colour_);
    glBindRenderbuffer(GL_RENDERBUFFER, colour_);
    glRenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8, size.width, size.height);
    glGenFramebuffers(1, &framebuffer_);
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, colour_);
  }
  ~HeadlessContext() override {
    glDeleteFramebuffers(1, &framebuffer_);
    glDeleteRenderbuffers(1, &colour_);
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(display_, context_);
    eglTerminate(display_);
  }
  void poll_events() override {}
  Size size() const override { return size_; }
  bool should_close() const override { return false; }
  unsigned framebuffer() const override { return framebuffer_; }
  void present() override { glFlush(); }

 private:
  EGLDisplay display_;
  EGLContext context_;
  Size size_;
  GLuint framebuffer_ = 0, colour_ = 0;
};

Error no_context(const char* what) {
  return Error{ErrorCode::ResourceMissing,
               std::string("no OpenGL without a display (") + what +
                   "): install Mesa's drivers (libgl1-mesa-dri, libegl1), or use --no-render"};
}

}  // namespace

Result<std::unique_ptr<GlContext>> make_headless_context(Size size) {
  const auto get_display = reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(
      eglGetProcAddress("eglGetPlatformDisplayEXT"));
  if (get_display == nullptr) return no_context("EGL has no platforms");
  EGLDisplay display = get_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
  if (display == EGL_NO_DISPLAY || eglInitialize(display, nullptr, nullptr) == EGL_FALSE)
    return no_context("EGL surfaceless does not start");
  eglBindAPI(EGL_OPENGL_API);
  const EGLint wanted[] = {EGL_SURFACE_TYPE, 0, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
  EGLConfig config = nullptr;
  EGLint count = 0;
  if (eglChooseConfig(display, wanted, &config, 1, &count) == EGL_FALSE || count == 0)
    return no_context("EGL has no OpenGL configuration");
  const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                               3,
                               EGL_CONTEXT_MINOR_VERSION,
                               3,
                               EGL_CONTEXT_OPENGL_PROFILE_MASK,
                               EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                               EGL_NONE};
  EGLContext context = eglCreateContext(display, config, EGL_NO_CONTEXT, attributes);
  if (context == EGL_NO_CONTEXT) return no_context("no OpenGL 3.3 core");
  if (eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context) == EGL_FALSE)
    return no_context("the context needs a surface");
  return std::unique_ptr<GlContext>(std::make_unique<HeadlessContext>(display, context, size));
}

}  // namespace trocar::render
