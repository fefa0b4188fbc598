#pragma once

// How a cutter makes the tets that a patch of a blade's path crosses into a wound: it labels nodes
// as lying on the wound, and bisects edges where no node is near enough. Sessions use splitter.h;
// Settings::make_splitter puts another method in its place.

#include <cstdint>
#include <span>

namespace trocar::cutting {

class CutMesh;
struct PatchTriangle;
struct Stroke;

class PatchSplitter {
 public:
  virtual ~PatchSplitter() = default;

  // Returns whether the patch is finished; takes what it did from `budget`. A patch that is not
  // finished is given again.
  virtual bool run(CutMesh& mesh, Stroke& stroke, std::span<const PatchTriangle> patch,
                   std::uint32_t& budget) = 0;
};

}  // namespace trocar::cutting
