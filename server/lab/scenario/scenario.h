#pragma once

// Scenarios: experiments on one organ without people. Which organ and material, which nodes are
// held, moved, loaded and probed over time, which scripted tools act, what is written. Read from a
// TOML file of which scripts are a part; docs/scripts-and-scenarios.md describes it.
//
// Two steps: parse_scenario() checks the file by itself, resolve() checks it against the organ and
// turns names into nodes. Errors of both are one line with file, line and key.
// Units: SI here; the file has them in each key's name. Immutable after reading: any thread.

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/tool/script.h"
#include "server/organs/material/material_keys.h"
#include "server/organs/organ/organ.h"
#include "server/papers/nakao/adaptive_splitter.h"
#include "server/tissue/step/external_loads.h"
#include "server/tissue/thread/rules.h"

namespace trocar::scenario {

inline constexpr std::size_t kScenarioFileLimitBytes = 16u << 20;
inline constexpr double kScenarioTimeLimit = 3600;         // s
inline constexpr std::uint32_t kScenarioRateLimit = 1000;  // rows per second of simulated time

// A place is where an entry stands in the file; error messages quote it.
struct Place {
  int line = 0;
  std::string key;
};

struct ScenarioOrgan {
  Place place;
  // The source is what load_organ() takes, "lattice" or "block". Files are relative to the
  // scenario.
  std::string source;
  std::optional<std::array<int, 3>> lattice_nodes;  // of a lattice or block
  std::optional<double> lattice_spacing_m;
};

// Values that are set here replace those of the organ's own material.
struct MaterialChange {
  Place place;                                                              // of the table
  std::vector<Place> given;                                                 // of each key in it
  std::array<std::optional<double>, material::kNumberKeys.size()> numbers;  // per key
  std::optional<material::ElasticLaw> elastic_law;
  std::optional<std::string> measured;  // name of a measured material
  std::optional<bool> has_averaged_strain;
  std::optional<Vec3d> fibre_direction;

  // Whether the number of this member is set.
  bool sets(double material::Material::*member) const;
  // Returns the place of the key with this name, or of the table if the key is not in it.
  const Place& place_of(std::string_view key) const;
};

// A named set: exactly one of ids, csv, box and near is given, or else `is_on_surface` alone.
struct NodeRule {
  Place place;
  std::string name;
  std::optional<std::vector<std::int64_t>> ids;
  std::optional<std::string> csv;  // file of ids, relative to the scenario
  Place ids_place;                 // of either
  struct Box {
    Vec3d low_m, high_m;
  };
  std::optional<Box> box;  // rest positions, edges included to within 1 um
  struct Near {
    Vec3d point_m;
    std::optional<double> radius_m;  // all within it; without: the nearest one
  };
  std::optional<Near> near;
  bool is_on_surface = false;  // of what the rest selects, only nodes of the surface
};

// The name of a set where it is used.
struct SetUse {
  Place place;
  std::string name;
};

using step::kAllAxes;
using step::TimedVector;

// A part of the organ with a material of its own.
struct RegionRule {
  std::string name;
  std::optional<SetUse> set;  // without: the organ's own region of this name is changed
  MaterialChange material;
};

struct DisplacementRule {
  SetUse set;
  std::uint8_t axes = kAllAxes;  // held ones; the set is free along the others
  TimedVector over_time;         // m
};

struct ForceRule {
  SetUse set;
  TimedVector over_time;  // total, N
};

// On the surface triangles whose three nodes are in the set. Areas and normals are those at rest.
struct TractionRule {
  SetUse set;
  bool is_pressure = false;  // along the inward normal, value in x; otherwise a vector
  TimedVector over_time;     // Pa
};

enum class ProbeQuantity : std::uint8_t {
  Displacement,  // mean of the set, m
  Velocity,      // mean of the set, m/s
  Reaction,      // total force that holds the set, on the tissue, N
  ToolForce,     // of tissue and thread on a tool, N
  StartForce,    // of a thread on what holds its start, N
  EndForce,      // likewise of its end
};

struct ProbeRule {
  std::string name;  // of the columns
  std::optional<SetUse> set;
  std::optional<std::uint32_t> tool;    // ToolForce
  std::optional<std::uint32_t> thread;  // StartForce and EndForce
  Place place;
  ProbeQuantity quantity = ProbeQuantity::Displacement;
  std::uint32_t every_ticks = 10;
};

enum class RunMode : std::uint8_t {
  Dynamic,
  Static,  // equilibrium at each load step
};

enum class Boundary : std::uint8_t {
  Whole,   // every node moves, equally well solved
  Frozen,  // only the queue around tools and loads moves
  Graded,  // every node moves, the queue is swept more
};

enum class Integrator : std::uint8_t { Implicit, Explicit };

struct RunRule {
  RunMode mode = RunMode::Dynamic;
  double seconds = 0;
  std::vector<double> load_times_s;  // of the steps of a static run, increasing
  bool starts_in_equilibrium = false;
  Integrator integrator = Integrator::Implicit;
  std::uint32_t steps_per_tick = 1;  // 1 ms / dt
  Boundary boundary = Boundary::Whole;
  // These limit the queue in layers and in nodes, as in a session; without them it is unlimited.
  std::optional<std::uint32_t> depth, nodes;
  std::uint32_t sweeps = 4;
  bool has_sweeps_for_organ = false;  // as sessions do, instead
  double over_relaxation = 1.5;
  // Graded, outside the queue; without: what the organ needs.
  std::optional<std::uint32_t> far_sweeps;
  std::optional<double> far_over_relaxation;
  bool has_linear_far_field = false;      // as in sessions
  std::optional<nakao::Variant> cutting;  // of a paper; without: as in sessions
  bool self_contact = true;               // tissue does not pass through tissue; dynamic runs
  double tolerance_n = 1e-5;              // of the full solver: residual at which a step is done
  std::uint32_t max_sweeps = 2000;        // of the full solver
  std::vector<Place> given;               // of each key in [run]

  double dt_s() const { return 1e-3 / steps_per_tick; }
};

struct Scenario {
  std::filesystem::path source;  // the file
  ScenarioOrgan organ;
  MaterialChange material;
  std::vector<NodeRule> node_rules;
  bool keeps_organ_fixed = true;
  std::vector<SetUse> fixes;
  std::vector<RegionRule> regions;
  std::vector<DisplacementRule> displacements;
  std::vector<ForceRule> forces;
  std::vector<TractionRule> tractions;
  std::optional<Vec3d> gravity_m_s2;  // without: the organ's own
  Place gravity_place;
  std::vector<tool::ScriptTool> tools;
  std::optional<thread::Rules> threads;
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

// Displaced and loaded nodes; forces and tractions are one there.
using step::DisplacedNodes;
using step::LoadedNodes;

// A scenario on its organ. No node is held twice along an axis, and no force acts along an axis
// along which its node is held; tractions may reach held nodes beside free ones.
struct ResolvedScenario {
  Scenario scenario;
  organ::Organ organ;  // with the scenario's materials, gravity and fixed nodes
  std::vector<DisplacedNodes> displacements;
  std::vector<LoadedNodes> forces;         // and tractions
  std::vector<NodeList> probe_nodes;       // per probe; empty for a tool's
  std::vector<tool::AnchorPoint> anchors;  // per tool
};

// Returns the place of a key in the list, or `other` if the key is not in it.
const Place& place_of_key(const std::vector<Place>& places, std::string_view key,
                          const Place& other);
// "file:line: key k: what", for what is found out after reading.
Error scenario_error(const Scenario& scenario, const Place& place, const std::string& what);

Result<ResolvedScenario> resolve(Scenario scenario);

// A tool of it has the verb "cut".
bool has_blade(const Scenario& scenario);

}  // namespace trocar::scenario
