#pragma once

// The tables of a scenario's TOML form, one reader each, for scenario_toml.cpp. After an error,
// which the document keeps, what is returned means nothing.

#include <string>
#include <vector>

#include "common/scene/scenario.h"
#include "common/scene/toml_reader.h"

namespace trocar::scene {

inline constexpr std::size_t kMaxScenarioTables = 1000;  // of one kind

// "table[i]"
std::string table_entry(const char* table, std::size_t i);
Place place_of(const TableReader& reader, std::string_view key);
std::vector<Place> places_of_keys(const TableReader& reader);
// The [[name]] tables, not too many of them.
std::vector<const toml::table*> limited_tables(TableReader& root, const char* name);
// The set that the table is about, if it says so.
std::optional<SetUse> read_set(TableReader& reader);

MaterialChange read_material(TableReader& reader);  // and finishes the reader
std::vector<RegionRule> read_regions(Document& document, TableReader& root);
std::vector<NodeRule> read_node_rules(Document& document, TableReader& root);
std::vector<DisplacementRule> read_displacements(Document& document, TableReader& root);
std::vector<ForceRule> read_forces(Document& document, TableReader& root);
std::vector<TractionRule> read_tractions(Document& document, TableReader& root);
RunRule read_run(TableReader& reader);  // and finishes the reader

}  // namespace trocar::scene
