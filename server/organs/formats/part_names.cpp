#include "server/organs/formats/part_names.h"

#include "server/organs/mesh/raw_tets.h"

namespace trocar::formats {

void PartNames::add(const std::string& kind, std::string_view name) {
  const auto first = name.find_first_not_of(' '), last = name.find_last_not_of(' ');
  if (first != name.npos) names_[kind].emplace(name.substr(first, last + 1 - first));
}

void PartNames::say(std::vector<std::string>& left_out) const {
  for (const auto& [kind, names] : names_)
    left_out.push_back("left out the names of " + kind + ": " +
                       mesh::list_of({names.begin(), names.end()}));
}

}  // namespace trocar::formats
