#pragma once

// Turns the names and rules of a scenario into nodes and materials of its organ, for scenario.cpp.
// Holds a reference to the scenario. One thread.

#include <string>

#include "server/lab/scenario/scenario.h"

namespace trocar::scenario {

class Resolver {
 public:
  explicit Resolver(const Scenario& scenario) : scenario_(scenario) {}

  const Scenario& scenario() const { return scenario_; }
  Error wrong(const Place& place, const std::string& what) const {
    return scenario_error(scenario_, place, what);
  }

  // The scenario's organ with its materials, gravity and fixed nodes.
  Result<organ::Organ> make_organ() const;
  // The nodes of a set that is named somewhere; not empty.
  Result<NodeList> nodes_of(const SetUse& use, const organ::Organ& organ) const;
  // The nodes that a rule selects; not empty.
  Result<NodeList> select(const NodeRule& rule, const organ::Organ& organ) const;

 private:
  Result<organ::Organ> source_organ() const;
  Status change_materials(organ::Organ& organ) const;
  Status change_material(const MaterialChange& change, const organ::Organ& organ,
                         material::Material& material) const;
  Result<NodeList> read_ids(const NodeRule& rule, std::size_t node_count) const;

  const Scenario& scenario_;
};

}  // namespace trocar::scenario
