#pragma once

#include <gtest/gtest.h>

#include "server/organs/label_map/label_map.h"

namespace trocar::testing {

// A block of 20 x 20 x 20 voxels of 3 mm: label 4 below, label 7 above.
inline label_map::LabelMap two_halves() {
  label_map::LabelMap map;
  map.size = {24, 24, 24};
  map.labels.resize(24 * 24 * 24);
  for (int k = 2; k < 22; ++k)
    for (int j = 2; j < 22; ++j)
      for (int i = 2; i < 22; ++i) map.labels[map.index(i, j, k)] = j < 12 ? 4 : 7;
  EXPECT_TRUE(
      set_place({}, {Vec3d{0.003, 0, 0}, Vec3d{0, 0.003, 0}, Vec3d{0, 0, 0.003}}, map).ok());
  map.names = {{4, "Liver"}, {7, "Left kidney"}};
  return map;
}

}  // namespace trocar::testing
