// A calculation that is saved and goes on is the one that was never stopped; bad files are refused.

#include "server/lab/finite_elements/state_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "common/base/checksum.h"
#include "tests/finite_elements/specimens.h"
#include "tests/support/files.h"

namespace trocar::finite_elements::testing {
namespace {

using trocar::testing::TemporaryFolder;

Specimen pulled_block(double pull_pa = 300) {
  Specimen block({2, 2, 2}, 0.005, ElementOrder::Quadratic, liver());
  block.hold_all_axes(plane(1, 0));
  block.pull(plane(1, 0.01), {0, pull_pa, 0});
  return block;
}

void advance(Solver& solver, const Specimen& block, int from, int to) {
  for (int i = from; i < to; ++i)
    ASSERT_TRUE(
        solver
            .step(block.loads(std::min(1.0, (i + 1) * 0.25)), {.dt_s = 0.01, .has_inertia = i >= 2})
            .is_converged);
}

TEST(StateFile, GoesOnToTheBit) {
  const auto block = pulled_block();
  Solver whole(block.problem()), first(block.problem(), {.threads = 1}), second(block.problem());
  advance(whole, block, 0, 8);
  advance(first, block, 0, 4);
  const auto state = to_state(to_bytes(first.state(), hash_of(first.problem())), second.problem());
  ASSERT_TRUE(state.ok()) << state.error().message;
  second.restore(*state);
  advance(second, block, 4, 8);
  EXPECT_EQ(whole.displacements(), second.displacements())
      << "neither the file nor the number of threads changes a result";
  EXPECT_EQ(whole.velocities(), second.velocities());
  EXPECT_EQ(whole.time_s(), second.time_s());
  EXPECT_EQ(whole.reactions(), second.reactions());
}

TEST(StateFile, RefusesWhatIsCutShortChangedOrOfAnotherProblem) {
  const auto block = pulled_block();
  Solver solver(block.problem());
  advance(solver, block, 0, 1);
  const Bytes good = to_bytes(solver.state(), hash_of(solver.problem()));
  ASSERT_TRUE(to_state(good, solver.problem()).ok());
  for (std::size_t length = 0; length < good.size(); length += 1 + good.size() / 200)
    EXPECT_FALSE(to_state(BytesView(good).first(length), solver.problem()).ok()) << length;
  for (std::size_t at = 0; at < good.size(); at += 1 + good.size() / 200) {
    Bytes changed = good;
    changed[at] ^= 0x10;
    EXPECT_FALSE(to_state(changed, solver.problem()).ok()) << at;
  }
  Problem other = block.problem();
  other.materials[0].coefficients_pa[0] *= 2;
  const auto refused = to_state(good, other);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("another organ, material"), std::string::npos);
}

// Another program could have written these states: one field is wrong, but the checksum is right.
TEST(StateFile, RefusesEachFieldThatIsWrong) {
  const auto block = pulled_block();
  Solver solver(block.problem());
  advance(solver, block, 0, 1);
  const Bytes good = to_bytes(solver.state(), hash_of(solver.problem()));
  const auto refused = [&](Bytes bytes, const std::string& says) {
    bytes.resize(bytes.size() - sizeof(std::uint32_t));
    const auto sum = crc32(bytes);
    ByteWriter(bytes).put(sum);
    const auto state = to_state(bytes, solver.problem());
    ASSERT_FALSE(state.ok()) << says;
    EXPECT_NE(state.error().message.find(says), std::string::npos) << state.error().message;
  };
  const auto with = [&](std::size_t at, auto value) {
    Bytes bytes = good;
    std::memcpy(&bytes.at(at), &value, sizeof value);
    return bytes;
  };
  constexpr std::size_t kVersionAt = 8, kProblemAt = 12, kTimeAt = 20, kFirstArrayAt = 45;
  refused(with(0, 'X'), "is no state");
  refused(with(kVersionAt, std::uint32_t{1}), "another version");
  refused(with(kProblemAt, std::uint64_t{1}), "another organ, material");
  refused(with(kTimeAt, double{NAN}), "not finite");
  refused(with(kFirstArrayAt, std::uint64_t{3}), "arrays of the wrong length");
  refused(with(kFirstArrayAt, ~std::uint64_t{0}), "arrays of the wrong length");
  refused(with(kFirstArrayAt + 8, double{INFINITY}), "not finite");
  Bytes longer = good;
  longer.insert(longer.end(), 8, 0);
  refused(longer, "arrays of the wrong length");
  Bytes shorter = good;
  shorter.resize(shorter.size() - 8);
  refused(shorter, "arrays of the wrong length");
}

// A file that claims to be large is refused by its head and its length, before it is read.
TEST(StateFile, IsNotReadBeyondItsHeadIfItsLengthIsWrong) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.state");
  const auto block = pulled_block();
  Solver solver(block.problem());
  ASSERT_TRUE(write_state(path, solver).ok());
  const auto size = std::filesystem::file_size(path);
  const auto says = [&] {
    const auto state = read_state(path, solver.problem());
    return state.ok() ? "" : state.error().message.substr(path.size());
  };
  std::filesystem::resize_file(path, std::uintmax_t{1} << 40);  // sparse
  EXPECT_EQ(says(), ": is damaged, its length does not fit: start again without it");
  std::filesystem::resize_file(path, size - 1);
  EXPECT_EQ(says(), ": is damaged, its length does not fit: start again without it");
  std::ofstream(path) << "TROCARFE";
  EXPECT_EQ(says(), ": is of another version of this program");
  std::ofstream(path) << "no state";
  EXPECT_EQ(says(), ": is no state of the off-line solver");
  std::ofstream(path) << "";
  EXPECT_EQ(says(), ": is no state of the off-line solver");
}

TEST(StateFile, IsWrittenAndReadByItsPath) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.state");
  const auto block = pulled_block();
  Solver solver(block.problem());
  advance(solver, block, 0, 1);
  ASSERT_TRUE(write_state(path, solver).ok());
  const auto state = read_state(path, solver.problem());
  ASSERT_TRUE(state.ok()) << state.error().message;
  EXPECT_EQ(state->u, solver.displacements());
  std::filesystem::remove(path);
  const auto missing = read_state(path, solver.problem());
  ASSERT_FALSE(missing.ok());
  EXPECT_NE(missing.error().message.find("cannot be opened"), std::string::npos);
}

}  // namespace
}  // namespace trocar::finite_elements::testing
