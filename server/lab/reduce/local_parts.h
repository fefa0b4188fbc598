#pragma once

// A folder keeps what an interrupted run of build_local() has done: a file per centre that was
// pressed and per patch, each written whole or not at all, and the run's own key. Different files
// may be read and written by several threads at once.

#include <filesystem>
#include <optional>
#include <vector>

#include "common/base/result.h"
#include "server/lab/reduce/karhunen_loeve.h"
#include "server/organs/organ/local_reduction.h"

namespace trocar::reduce {

// All presses at one centre.
struct Pressed {
  std::vector<Vector> fields;
  std::size_t failed = 0;
};

// These parts of a patch take long to make.
struct FinishedPatch {
  std::vector<organ::PackedField> modes;
  std::vector<organ::CubatureTet> cubature;
  std::vector<double> outer_stiffness, mass;
  double nonlinear = 0, residual = 0;
};

class LocalParts {
 public:
  // None are kept.
  LocalParts() = default;
  // key: one line, the same for runs with the same result. Makes the folder, or takes what is in it
  // if it has this key. Error: it has another one, or cannot be made.
  static Result<LocalParts> open(const std::filesystem::path& folder, const std::string& key);

  // Nothing: it is not there, or damaged.
  std::optional<Pressed> read_pressed(std::size_t number, std::size_t field_length) const;
  std::optional<FinishedPatch> read_patch(std::size_t number) const;
  Status write(std::size_t number, const Pressed& pressed) const;
  Status write(std::size_t number, const FinishedPatch& patch) const;

 private:
  std::filesystem::path folder_;  // empty: none
};

}  // namespace trocar::reduce
