#pragma once

// Scenarios: experiments on one organ without people. Which organ and material, which nodes are
// held, moved, loaded and probed over time, which scripted tools act, what is written. Read from a
// TOML file of which scripts are a part; README, "Scenarios", describes it to a person.
//
// Two steps: parse_scenario() checks the file by itself, resolve() checks it against the organ and
// turns names into nodes. Errors of both are one line with file, line and key.
// Units: SI here; the file has them in each key's name. Immutable after reading: any thread.

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/scene/organ.h"
#include "common/scene/script.h"

namespace trocar::scene {

inline constexpr std::size_t kScenarioFileLimitBytes = 16u << 20;
inline constexpr double kScenarioTimeLimit = 3600;         // s
inline constexpr std::uint32_t kScenarioRateLimit = 1000;  // rows per second of simulated time

// Where something stands in the file, for messages about it.
struct Place {
  int line = 0;
  std::string key;
};

struct ScenarioOrgan {
  Place place;
  std::string source;  // as load_organ() takes it; files are relative to the scenario
  std::optional<std::array<int, 3>> lattice_nodes;
  std::optional<double> lattice_spacing_m;
};

// What is set replaces the organ's own.
struct MaterialChange {
  Place place;
  std::optional<double> density_kg_m3;
  std::optional<double> young_modulus_pa;
  std::optional<double> spring_stiffness_n_m;
  std::optional<double> node_damping_per_s;
  std::optional<double> spring_damping_time_s;
};

// A named set: exactly one of ids, box and point is given.
struct NodeRule {
  Place place;
  std::string name;
  std::optional<std::vector<std::int64_t>> ids;
  struct Box {
    Vec3d low_m, high_m;
  };
  std::optional<Box> box;  // rest positions, edges included to within 1 um
  struct Near {
    Vec3d point_m;
    std::optional<double> radius_m;  // all within it; without: the nearest one
  };
  std::optional<Near> near;
};

// The name of a set where it is used.
struct SetUse {
  Place place;
  std::string name;
};

// A vector over time: linear between keys, constant before the first and after the last.
struct TimedVector {
  struct Key {
    double time_s = 0;  // strictly increasing
    Vec3d value;
  };
  std::vector<Key> keys;  // at least one

  Vec3d at(double time_s) const;
};

struct LoadRule {
  SetUse set;
  TimedVector over_time;  // displacement in m, or total force in N
};

enum class ProbeQuantity : std::uint8_t {
  Displacement,  // mean of the set, m
  Velocity,      // mean of the set, m/s
  Reaction,      // total force that holds the set, on the tissue, N
  ToolForce,     // of the tissue on a tool, N
};

struct ProbeRule {
  std::string name;  // of the columns
  std::optional<SetUse> set;
  std::optional<std::uint32_t> tool;  // ToolForce
  Place place;
  ProbeQuantity quantity = ProbeQuantity::Displacement;
  std::uint32_t every_ticks = 10;
};

struct RunRule {
  double seconds = 0;
  std::uint32_t sweeps = 4;
  double over_relaxation = 1.5;
  // Layers and nodes around tools and loads, as in a session; neither: the whole organ moves.
  std::optional<std::uint32_t> depth, nodes;
  double tolerance_n = 1e-5;        // of the full solver: residual at which a step is done
  std::uint32_t max_sweeps = 2000;  // of the full solver
};

struct Scenario {
  std::filesystem::path source;  // the file
  ScenarioOrgan organ;
  MaterialChange material;
  std::vector<NodeRule> node_rules;
  bool keeps_organ_fixed = true;
  std::vector<SetUse> fixes;
  std::vector<LoadRule> displacements, forces;
  Vec3d gravity_m_s2;
  Place gravity_place;
  std::vector<ScriptTool> tools;
  RunRule run;
  Place run_place;
  std::vector<ProbeRule> probes;
  std::optional<std::string> output_folder;
  std::vector<double> field_times_s;  // increasing
};

Result<Scenario> parse_scenario(const std::filesystem::path& path);
// `source` stands for the file's path: in messages, and for files relative to it.
Result<Scenario> parse_scenario_text(std::string_view text, std::string_view source);

using NodeList = std::vector<NodeIndex>;  // ascending, distinct, not empty

struct ResolvedLoad {
  NodeList nodes;
  TimedVector over_time;
};

// A scenario on its organ. Fixed nodes (organ.fixed_nodes), displaced nodes and loaded nodes have
// no node in common, except that forces may add up.
struct ResolvedScenario {
  Scenario scenario;
  Organ organ;  // with the scenario's material and fixed nodes
  std::vector<ResolvedLoad> displacements, forces;
  std::vector<NodeList> probe_nodes;  // per probe; empty for a tool's
  std::vector<AnchorPoint> anchors;   // per tool
};

Result<ResolvedScenario> resolve(Scenario scenario);

}  // namespace trocar::scene
