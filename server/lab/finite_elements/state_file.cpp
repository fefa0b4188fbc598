#include "server/lab/finite_elements/state_file.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include "common/base/checksum.h"
#include "common/base/text_file.h"

namespace trocar::finite_elements {
namespace {

constexpr std::string_view kMagic = "TROCARFE";
constexpr std::uint32_t kVersion = 2;
constexpr std::size_t kHeadBytes = kMagic.size() + sizeof kVersion + sizeof(std::uint64_t);

void put(ByteWriter& out, const double* values, std::size_t count) {
  out.put(static_cast<std::uint64_t>(count));
  out.put_bytes(bytes_of(std::span(values, count)));
}
void put(ByteWriter& out, const Vector& v) {
  put(out, v.data(), static_cast<std::size_t>(v.size()));
}

// False where the length is not `count` or a number is not finite.
bool take(ByteReader& in, double* values, std::size_t count) {
  if (in.read<std::uint64_t>() != count) return false;
  const auto bytes = in.read_bytes(count * sizeof(double));
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

Error bad(const std::string& what) {
  return {ErrorCode::BadFile, what};
}

Status take_magic(ByteReader& in) {
  const auto magic = in.read_bytes(kMagic.size());
  if (!std::equal(magic.begin(), magic.end(), kMagic.begin(), kMagic.end()))
    return bad("is no state of the off-line solver");
  return {};
}

Status take_version_and_problem(ByteReader& in, const Problem& problem) {
  if (in.read<std::uint32_t>() != kVersion) return bad("is of another version of this program");
  if (in.read<std::uint64_t>() != hash_of(problem))
    return bad("is of another organ, material, boundary or order of elements");
  return {};
}

// Returns the size of a file of this problem's state, whatever the state holds.
std::uintmax_t size_of(const Problem& problem) {
  const std::uintmax_t dofs = problem.dof_count();
  const std::uintmax_t numbers = 5 * dofs + problem.held_dofs.size() + history_length(problem);
  constexpr std::uintmax_t kArrays = 7, kNumber = 8;
  return kHeadBytes + 3 * kNumber + sizeof(std::uint8_t) + kNumber * (kArrays + numbers) +
         sizeof(std::uint32_t);
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
  out.put(state.path);
  out.put(static_cast<std::uint8_t>(state.is_moving));
  for (const auto* v :
       {&state.u, &state.velocity, &state.acceleration, &state.internal, &state.loads.forces})
    put(out, *v);
  for (const auto* v : {&state.loads.held_moves, &state.history}) put(out, v->data(), v->size());
  out.put(crc32(bytes));
  return bytes;
}

Result<State> to_state(BytesView bytes, const Problem& problem) {
  if (bytes.size() < kMagic.size() + sizeof(std::uint32_t)) return bad("is no state, too short");
  const BytesView content = bytes.first(bytes.size() - sizeof(std::uint32_t));
  ByteReader in(content), end(bytes.subspan(content.size()));
  if (auto s = take_magic(in); !s) return s.error();
  if (end.read<std::uint32_t>() != crc32(content))
    return bad("is damaged, its checksum does not fit: start again without it");
  if (auto s = take_version_and_problem(in, problem); !s) return s.error();
  State state;
  state.time_s = in.read<double>();
  state.steps = in.read<std::uint64_t>();
  state.path = in.read<std::uint64_t>();
  state.is_moving = in.read<std::uint8_t>() != 0;
  const std::size_t dofs = problem.dof_count();
  bool is_good = std::isfinite(state.time_s);
  for (auto* v :
       {&state.u, &state.velocity, &state.acceleration, &state.internal, &state.loads.forces})
    is_good = is_good && take(in, *v, dofs);
  is_good = is_good && take(in, state.loads.held_moves, problem.held_dofs.size()) &&
            take(in, state.history, history_length(problem));
  if (!is_good || !in.ok() || in.remaining() != 0)
    return bad("has arrays of the wrong length, or numbers that are not finite");
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
  // The head is read before memory is taken for all of it.
  Bytes bytes(std::min<std::uintmax_t>(size, kHeadBytes));
  const auto read_to = [&](std::size_t begin) {
    file.read(reinterpret_cast<char*>(bytes.data() + begin),
              static_cast<std::streamsize>(bytes.size() - begin));
    return static_cast<bool>(file);
  };
  if (!read_to(0)) return wrong("cannot be read");
  ByteReader head{BytesView(bytes)};
  if (auto s = take_magic(head); !s) return wrong(s.error().message);
  if (auto s = take_version_and_problem(head, problem); !s) return wrong(s.error().message);
  if (size != size_of(problem))
    return wrong("is damaged, its length does not fit: start again without it");
  bytes.resize(static_cast<std::size_t>(size));
  if (!read_to(kHeadBytes)) return wrong("cannot be read");
  auto state = to_state(bytes, problem);
  if (!state) return wrong(state.error().message);
  return state;
}

}  // namespace trocar::finite_elements
