#pragma once

// OpenGL 3.3 core, without a loader: libglvnd exports the entry points. Only client/render and
// client/ui include this.

#ifndef GL_GLEXT_PROTOTYPES
#define GL_GLEXT_PROTOTYPES
#endif
#include <GL/gl.h>
#include <GL/glext.h>
