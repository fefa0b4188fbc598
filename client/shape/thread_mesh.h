#pragma once

// Surgical thread as tubes in the colour of its material, and the pegs that it meets.

#include <span>

#include "client/shape/tool_mesh.h"
#include "common/wire/thread_codec.h"

namespace trocar::shape {

// Appends to `out`, in the world frame. places: m, per node of the picture; as many as there are in
// it. A segment that is parted is left out. Thread is drawn 0.7 mm thick, so that knots look
// closed.
void add_threads(const wire::ThreadPicture& picture, std::span<const Vec3f> places,
                 MeshVertices& out);

}  // namespace trocar::shape
