#pragma once

// The relief of tissue as tileable volume textures: made once, looked up by rest position, so that
// it moves with the tissue.

#include <cstdint>
#include <vector>

namespace trocar::shape {

// size^3 RGBA8 texels: slope in rgb (0.5 = flat), height in a. `size` is a power of two >= 16.
std::vector<std::uint8_t> make_tissue_noise(int size);
// Returns lobules likewise, as cut tissue shows them: domes of unequal size, creases between them.
std::vector<std::uint8_t> make_lobule_noise(int size);

}  // namespace trocar::shape
