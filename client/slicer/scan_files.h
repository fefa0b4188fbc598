#pragma once

// Writes what came from a peer as files that trocar-organ imports. Each is whole or not there.

#include <filesystem>

#include "client/slicer/incoming.h"
#include "common/base/result.h"

namespace trocar::slicer {

// NIfTI-1 (.nii), labels of 16 bits, placed by its sform in RAS, mm.
Status write_label_map(const std::filesystem::path& path, const LabelImage& image);
// Wavefront (.obj), RAS, mm.
Status write_surface(const std::filesystem::path& path, const SurfaceMesh& surface);

}  // namespace trocar::slicer
