#pragma once

// Makes a local reduction (server/organs/organ/local_reduction.h). Off-line, for every node of the
// surface that tools reach: the fields of unit forces, and of second order in the force. Around the
// centre of each patch, some presses are solved by the full model. A patch's modes are the first of
// these fields' Karhunen-Loeve modes, and of what inertia adds to them; its cubature is the
// solution of a non-negative least-squares problem over the same fields.

#include <filesystem>
#include <functional>

#include "server/lab/reduce/full_model.h"
#include "server/organs/organ/local_reduction.h"

namespace trocar::reduce {

struct LocalSettings {
  std::size_t modes = 12;          // of a patch
  std::size_t inertia_modes = 18;  // of a patch, of what inertia adds (inertia_fields.h)
  std::size_t vibrations = 36;     // of the whole organ, which all patches share
  double patch_radius_m = 0.012;   // its nodes are within, of its centre
  std::uint32_t free_layers = 2;   // of nodes around a touched one
  double force_n = 0.4;            // the largest, on a node
  std::size_t directions = 5;      // of the presses at a centre; 0: none are solved
  std::size_t field_nodes = 12;    // whose fields a patch's modes are of
  double residual = 1e-3;          // of the cubature, beside the whole forces; 0: all tets
  std::size_t patches = 0;         // made at most, from the first centre outwards; 0: all
  std::uint64_t seed = 1;
  unsigned threads = 1;
  // Finished parts are kept here until all is done, and looked for; empty: nowhere.
  std::filesystem::path parts;
};
// Error names the setting as trocar-organ calls it.
Status validate(const LocalSettings& settings);

enum class LocalStage { Greens, Presses, Patches };
// done and all: nodes, centres or patches. Called after each, by one thread at a time.
using LocalProgress = std::function<void(LocalStage stage, std::size_t done, std::size_t all)>;

struct LocalBuilt {
  organ::LocalReduction reduction;
  std::vector<NodeIndex> pressed;  // places of the training
  std::size_t failed = 0;          // presses without an equilibrium, left out
  // Per patch, beside the whole forces: what is not linear beyond the inner tets, and what cubature
  // leaves of it.
  std::vector<double> nonlinear, residuals;
};
// The same for every number of threads, in one run or, with the parts of those before, in several.
// Error: an organ that FullModel refuses, a law that is not unsplit, or no node that tools reach.
Result<LocalBuilt> build_local(const organ::Organ& organ, const LocalSettings& settings,
                               const LocalProgress& progress = {});

}  // namespace trocar::reduce
