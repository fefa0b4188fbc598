#pragma once

// A face of any number of corners as triangles around its first corner.

#include <cstdint>
#include <span>
#include <string>

#include "common/base/result.h"
#include "server/organs/surface/raw_surface.h"

namespace trocar::formats {

// Adds face `number` (from 1). Corners count from 0. Error, without the file's name: fewer than
// three corners, or one that is not among the positions.
Status add_polygon(std::span<const std::int64_t> corners, std::int64_t number,
                   surface::RawSurface& surface);

}  // namespace trocar::formats
