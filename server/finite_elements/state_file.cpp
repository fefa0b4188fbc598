#include "server/finite_elements/state_file.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include "common/base/checksum.h"
#include "common/base/text_file.h"

namespace trocar::finite_elements {
namespace {

constexpr std::string_view kMagic = "TROCARFE";
constexpr std::uint32_t kVersion = 1;
constexpr std::uintmax_t kLimitBytes = std::uintmax_t{8} << 30;

void put(ByteWriter& out, const double* values, std::size_t count) {
  out.put(static_cast<std::uint64_t>(count));
  out.put_bytes(bytes_of(std::span(values, count)));
}
void put(ByteWriter& out, const Vector& v) {
  put(out, v.data(), static_cast<std::size_t>(v.size()));
}

// False where the length is not `count` or a number is not finite.
bool take(ByteReader& in, double* values, std::size_t count) {
  if (in.take<std::uint64_t>() != count) return false;
  const auto bytes = in.take_bytes(count * sizeof(double));
  if (!in.ok()) return false;
  if (count > 0) std::memcpy(values, bytes.data(), bytes.size());
  for (std::size_t i = 0; i < count; ++i)
    if (!std::isfinite(values[i])) return false;
  return true;
}
bool take(ByteReader& in, Vector& v, std::size_t count) {
  v.resize(static_cast<Eigen::Index>(count));
  return take(in, v.data(), count);
}
bool take(ByteReader& in, std::vector<double>& v, std::size_t count) {
  v.resize(count);
  return take(in, v.data(), count);
}

std::size_t history_length(const Problem& problem) {
  std::size_t stride = 0;
  for (const auto& material : problem.materials)
    stride = std::max(stride, history_size(material.relaxation.size()));
  return stride * problem.mesh.points_per_element() * problem.mesh.element_count();
}

}  // namespace

Bytes to_bytes(const State& state, std::uint64_t problem_hash) {
  Bytes bytes;
  ByteWriter out(bytes);
  out.put_bytes(bytes_of(kMagic));
  out.put(kVersion);
  out.put(problem_hash);
  out.put(state.time_s);
  out.put(state.steps);
  out.put(static_cast<std::uint8_t>(state.is_moving));
  for (const auto* v :
       {&state.u, &state.velocity, &state.acceleration, &state.internal, &state.loads.forces})
    put(out, *v);
  for (const auto* v : {&state.loads.held_moves, &state.history}) put(out, v->data(), v->size());
  out.put(crc32(bytes));
  return bytes;
}

Result<State> to_state(BytesView bytes, const Problem& problem) {
  const auto wrong = [](const char* what) { return Error{ErrorCode::BadFile, what}; };
  if (bytes.size() < kMagic.size() + sizeof(std::uint32_t)) return wrong("is no state, too short");
  const BytesView content = bytes.first(bytes.size() - sizeof(std::uint32_t));
  ByteReader in(content), end(bytes.subspan(content.size()));
  const auto magic = in.take_bytes(kMagic.size());
  if (!std::equal(magic.begin(), magic.end(), kMagic.begin()))
    return wrong("is no state of the off-line solver");
  if (end.take<std::uint32_t>() != crc32(content))
    return wrong("is damaged, its checksum does not fit: start again without it");
  if (in.take<std::uint32_t>() != kVersion) return wrong("is of another version of this program");
  if (in.take<std::uint64_t>() != hash_of(problem))
    return wrong("is of another organ, material, boundary or order of elements");
  State state;
  state.time_s = in.take<double>();
  state.steps = in.take<std::uint64_t>();
  state.is_moving = in.take<std::uint8_t>() != 0;
  const std::size_t dofs = problem.dof_count();
  bool is_good = std::isfinite(state.time_s);
  for (auto* v :
       {&state.u, &state.velocity, &state.acceleration, &state.internal, &state.loads.forces})
    is_good = is_good && take(in, *v, dofs);
  is_good = is_good && take(in, state.loads.held_moves, problem.held_dofs.size()) &&
            take(in, state.history, history_length(problem));
  if (!is_good || !in.ok() || in.remaining() != 0) return wrong("has arrays of the wrong length");
  return state;
}

Status write_state(const std::filesystem::path& path, const Solver& solver) {
  const Bytes bytes = to_bytes(solver.state(), hash_of(solver.problem()));
  return write_text_file(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

Result<State> read_state(const std::filesystem::path& path, const Problem& problem) {
  const auto wrong = [&](const std::string& what) {
    return Error{ErrorCode::BadFile, path.string() + ": " + what};
  };
  std::error_code missing;
  const auto size = std::filesystem::file_size(path, missing);
  std::ifstream file(path, std::ios::binary);
  if (missing || !file) return wrong("cannot be opened, check name and rights");
  if (size > kLimitBytes) return wrong("is larger than 8 GiB, no state is");
  Bytes bytes(size);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (!file) return wrong("cannot be read");
  auto state = to_state(bytes, problem);
  if (!state) return wrong(state.error().message);
  return state;
}

}  // namespace trocar::finite_elements
