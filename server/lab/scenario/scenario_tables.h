#pragma once

// The tables of a scenario's TOML form, one reader each, for scenario_toml.cpp. After an error,
// which the document keeps, what is returned means nothing.

#include <string>
#include <vector>

#include "common/tool/toml_reader.h"
#include "server/lab/scenario/scenario.h"

namespace trocar::scenario {

inline constexpr std::size_t kMaxScenarioTables = 1000;  // of one kind

// "table[i]"
std::string table_entry(const char* table, std::size_t i);
Place place_of(const tool::TableReader& reader, std::string_view key);
std::vector<Place> places_of_keys(const tool::TableReader& reader);
// The [[name]] tables, not too many of them.
std::vector<const toml::table*> limited_tables(tool::TableReader& root, const char* name);
// The set that the table is about, if it says so.
std::optional<SetUse> read_set(tool::TableReader& reader);

MaterialChange read_material(tool::TableReader& reader);  // and finishes the reader
std::vector<RegionRule> read_regions(tool::Document& document, tool::TableReader& root);
std::vector<NodeRule> read_node_rules(tool::Document& document, tool::TableReader& root);
std::vector<DisplacementRule> read_displacements(tool::Document& document, tool::TableReader& root);
std::vector<ForceRule> read_forces(tool::Document& document, tool::TableReader& root);
std::vector<TractionRule> read_tractions(tool::Document& document, tool::TableReader& root);
RunRule read_run(tool::TableReader& reader);  // and finishes the reader

}  // namespace trocar::scenario
