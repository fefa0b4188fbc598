#include "server/tissue/cutting/small_pieces.h"

#include <algorithm>

namespace trocar::cutting {

void SmallPieces::clear() {
  for (const auto t : known_) sizes_[t.value] = kUnknown;
  known_.clear();
}

bool SmallPieces::has(const CutMesh& mesh, TetIndex tet) {
  sizes_.resize(std::max(sizes_.size(), mesh.topology().tet_count()));
  if (sizes_[tet.value] == kUnknown) look_into(mesh, tet);
  return sizes_[tet.value] == kSmall;
}

// Until all of the piece has been seen, or enough of it, or a tet of which it is known.
void SmallPieces::look_into(const CutMesh& mesh, TetIndex start) {
  const auto& topology = mesh.topology();
  const double h = mesh.h(topology.tet(start)[0]);
  const double enough = 6 * mesh.settings().whole_volume_h3 * h * h * h;
  double volume = 0;
  Size size = kSmall;
  piece_.assign(1, start);
  sizes_[start.value] = kSmall;
  for (std::size_t i = 0; i < piece_.size() && size == kSmall; ++i) {
    volume += six_volumes(rest_corners(topology, topology.tet(piece_[i])));
    if (volume >= enough) size = kLarge;
    for (std::uint8_t corner = 0; corner < 4; ++corner) {
      const auto other = across(topology, {piece_[i], corner});
      if (!other || sizes_[other->tet.value] == kSmall) continue;
      if (sizes_[other->tet.value] == kLarge) {
        size = kLarge;
        continue;
      }
      sizes_[other->tet.value] = kSmall;
      piece_.push_back(other->tet);
    }
  }
  for (const auto t : piece_) sizes_[t.value] = size;
  known_.insert(known_.end(), piece_.begin(), piece_.end());
}

}  // namespace trocar::cutting
