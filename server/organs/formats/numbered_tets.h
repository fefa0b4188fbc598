#pragma once

// Tetrahedra of a format that numbers nodes and elements: they are checked against the nodes as
// they come.

#include <array>
#include <cstdint>
#include <string>

#include "common/base/result.h"
#include "server/organs/formats/text_reader.h"
#include "server/organs/mesh/raw_tets.h"

namespace trocar::formats {

class NumberedTets {
 public:
  void add_node(std::int64_t number, const Vec3d& position) {
    raw.positions.push_back(position);
    raw.node_ids.push_back(number);
  }
  // Needed before the first tet. Error: a number is given twice.
  Status end_nodes(const TextReader& reader) { return numbers_.index(raw.node_ids, reader); }
  // Index of a node by the file's number. Error names `who`.
  Result<NodeIndex> node(std::int64_t number, const std::string& who,
                         const TextReader& reader) const;
  // Error: a node is missing or used twice.
  Status add_tet(std::int64_t number, const std::array<std::int64_t, 4>& nodes,
                 const TextReader& reader);

  mesh::RawTets raw;

 private:
  NodeNumbers numbers_;
};

}  // namespace trocar::formats
