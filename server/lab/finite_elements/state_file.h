#pragma once

// A solver's state in a file, to go on with a long calculation. Little-endian: magic, version,
// hash of the problem, numbers, arrays each with its length, CRC-32 of all before. The file appears
// complete or not at all; one of another problem, cut short or changed is refused.

#include <filesystem>

#include "common/base/bytes.h"
#include "server/lab/finite_elements/solver.h"

namespace trocar::finite_elements {

Bytes to_bytes(const State& state, std::uint64_t problem_hash);
Result<State> to_state(BytesView bytes, const Problem& problem);

Status write_state(const std::filesystem::path& path, const Solver& solver);
Result<State> read_state(const std::filesystem::path& path, const Problem& problem);

}  // namespace trocar::finite_elements
