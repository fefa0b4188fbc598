#pragma once

// A face of any number of corners as triangles.
//
// A convex face is cut around its first corner, a concave one ear by ear: a corner is cut off where
// the triangle with its neighbours holds no other corner. A face that is not plane is cut as its
// shadow on its mean plane. One that crosses itself has no such cut, and is cut around its first
// corner.
//
// Source: Meisters: Polygons have ears, American Mathematical Monthly 82(6), 1975.

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/organs/surface/raw_surface.h"

namespace trocar::formats {

inline constexpr std::size_t kMaxConcaveCorners = 128;  // the time goes by their third power

// Places of a triangle's corners in the list of the face's.
using PolygonCut = std::array<std::size_t, 3>;

// Adds face `number` (from 1). Corners count from 0. Error, without the file's name: fewer than
// three corners, one that is not among the positions, or more than kMaxConcaveCorners of a concave
// face. cuts: those of each triangle are added, if it is not null.
Status add_polygon(std::span<const std::int64_t> corners, std::int64_t number,
                   surface::RawSurface& surface, std::vector<PolygonCut>* cuts = nullptr);

}  // namespace trocar::formats
