#include "server/organs/formats/numbered_tets.h"

namespace trocar::formats {

Result<NodeIndex> NumberedTets::node(std::int64_t number, const std::string& who,
                                     const TextReader& reader) const {
  const auto found = numbers_.find(number);
  if (found < 0)
    return reader.error(who + " refers to node " + std::to_string(number) +
                        ", which the file does not have");
  return NodeIndex(static_cast<std::uint32_t>(found));
}

Status NumberedTets::add_tet(std::int64_t number, const std::array<std::int64_t, 4>& nodes,
                             const TextReader& reader) {
  const std::string who = "element " + std::to_string(number);
  mesh::Tet tet;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto index = node(nodes[i], who, reader);
    if (!index) return index.error();
    tet[i] = *index;
    for (std::size_t j = 0; j < i; ++j)
      if (nodes[j] == nodes[i])
        return reader.error(who + " uses node " + std::to_string(nodes[i]) + " twice");
  }
  raw.tets.push_back(tet);
  raw.element_ids.push_back(number);
  return {};
}

}  // namespace trocar::formats
