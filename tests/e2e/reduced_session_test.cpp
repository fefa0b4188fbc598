// Sessions with a local reduction, as processes: which solver acted is in the recording, and only
// the same reduction simulates it again.

#include <gtest/gtest.h>

#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <fstream>

#include "common/journal/session_journal.h"
#include "server/organs/organ/local_reduction_file.h"
#include "server/organs/organ/organ_file.h"
#include "server/session/recording/verify.h"
#include "tests/e2e/programs.h"
#include "tests/reduce/reduced_block.h"

namespace trocar::e2e {
namespace {

namespace fs = std::filesystem;

const reduce::testing::ReducedBlock& made() {
  static const reduce::testing::ReducedBlock instance(4);
  return instance;
}
void write_made(const fs::path& folder) {
  ASSERT_TRUE(organ::write_organ(folder / "block.organ", made().organ).ok());
  ASSERT_TRUE(organ::write_local_reduction(folder / "block.reduction", *made().local).ok());
  auto other = *made().local;
  other.force_n *= 2;
  ASSERT_TRUE(organ::write_local_reduction(folder / "other.reduction", other).ok());
}

// Presses at the first patch's centre along the normal there, and then cuts.
fs::path write_press_script(const fs::path& folder) {
  const auto& organ = made().organ;
  const auto& centre = made().centre(0);
  Vec3d out;
  Vec3d size;
  for (const auto& x : organ.mesh.rest_positions)
    size = {std::max(size.x, x.x), std::max(size.y, x.y), std::max(size.z, x.z)};
  // The press comes from the side on which the centre lies.
  if (std::abs(centre.y) > size.y - 1e-6)
    out.y = centre.y > 0 ? 1 : -1;
  else if (std::abs(centre.x) > size.x - 1e-6)
    out.x = centre.x > 0 ? 1 : -1;
  else
    out.z = centre.z > 0 ? 1 : -1;
  const auto file = folder / "press.toml";
  std::ofstream script(file);
  script << "[[tool]]\nradius_mm = 8\nedge_mm = 10\n";
  const auto key = [&](double time_s, double height_mm, double aside_mm, const char* verb) {
    const Vec3d at = centre * 1e3 + out * height_mm + Vec3d{out.y, out.z, out.x} * aside_mm;
    script << fmt::format(
        "[[tool.key]]\ntime_s = {}\nposition_mm = [{}, {}, {}]\nshaft = [{}, {}, {}]\nverb = "
        "\"{}\"\n",
        time_s, at.x, at.y, at.z, out.x, out.y, out.z, verb);
  };
  key(0, 20, 0, "none");
  key(0.5, 3, 0, "push");
  key(1, -3, 0, "push");
  key(2.5, -3, 0, "push");
  key(3, 10, 0, "none");
  key(3.2, 10, 0, "cut");
  key(3.8, -9, 0, "cut");
  key(4.5, -9, 20, "cut");
  key(60, -9, 20, "none");
  return file;
}

std::vector<proto::SolverChange> solver_changes(const fs::path& file) {
  std::vector<proto::SolverChange> changes;
  auto journal = journal::SessionJournal::open(file.string());
  EXPECT_TRUE(journal.ok());
  const auto read = (*journal)->read_solver_changes(0, (*journal)->info().last_tick,
                                                    [&](Tick, const proto::SolverLog& log) {
                                                      for (const auto& change : log.change())
                                                        changes.push_back(change);
                                                      return true;
                                                    });
  EXPECT_TRUE(read.ok());
  return changes;
}

// A program's exit code and what it printed.
std::pair<int, std::string> outcome(const std::string& name,
                                    const std::vector<std::string>& arguments,
                                    const fs::path& folder) {
  Program program(name, arguments, folder / "outcome.log");
  const int code = program.wait(120);
  return {code, read_text(folder / "outcome.log")};
}

TEST(ReducedSession, IsRecordedAndSimulatesAgainWithItsReductionOnly) {
  const auto folder = test_folder();
  write_made(folder);
  const auto reduction = (folder / "block.reduction").string();
  Session session((folder / "block.organ").string(),
                  {"--seconds", "6", "--reduction", reduction, "--log-level", "debug"});
  auto hand = session.hand("Hand", write_press_script(folder));
  auto watcher = session.client(
      "Watcher", "observer", {"--headless", "--fps", "2", "--size", "320x200", "--show", "ghost"});
  ASSERT_EQ(session.server().wait(300), 0) << read_text(folder / "server.log");
  EXPECT_EQ(hand.wait(20), 0) << read_text(folder / "Hand.log");
  EXPECT_EQ(watcher.wait(20), 0) << read_text(folder / "Watcher.log");

  const auto summary = read_text(folder / "server.json");
  EXPECT_EQ(json_value(summary, "all_replicas_equal"), "true") << summary;
  EXPECT_EQ(json_value(summary, "reduction"), "block.reduction");
  EXPECT_GT(json_number(summary, "reduced_ticks"), 100);
  EXPECT_EQ(json_number(summary, "reduced_ticks") + json_number(summary, "full_ticks"),
            json_number(summary, "ticks"));
  EXPECT_GE(json_number(summary, "to_reduced"), 1);
  EXPECT_GE(json_number(summary, "to_full"), 1);
  const auto log = read_text(folder / "server.log");
  EXPECT_NE(log.find("block.reduction: 4 patches, "), std::string::npos) << log;

  // The full solution beside it, which begins again after the cut.
  EXPECT_GT(json_number(session.summary_of("Watcher"), "ghosts"), 10);
  EXPECT_EQ(json_number(session.summary_of("Watcher"), "ghosts_ignored"), 0);
  EXPECT_GE(json_number(summary, "begun"), 1);
  EXPECT_LT(json_number(summary, "largest_mm"), 5);

  // Who acted when, and why.
  const auto changes = solver_changes(session.journal);
  ASSERT_GE(changes.size(), 3u) << summary;
  EXPECT_EQ(changes[0].tick(), 1u);
  EXPECT_EQ(changes[0].text(), "full, nothing touched yet");
  EXPECT_FALSE(changes[0].solver().is_reduced());
  EXPECT_EQ(changes[1].text(), "reduced, patch 1");
  EXPECT_TRUE(changes[1].solver().is_reduced());
  ASSERT_EQ(changes[1].solver().patch_size(), 1);
  EXPECT_EQ(changes[1].solver().patch(0), 1u);
  EXPECT_EQ(changes[1].solver().reason(), proto::SOLVER_FITS);
  const auto cut = std::ranges::find_if(changes, [](const proto::SolverChange& change) {
    return change.solver().reason() == proto::SOLVER_CUT;
  });
  ASSERT_NE(cut, changes.end());
  EXPECT_EQ(cut->text(), "full, tissue was cut");
  EXPECT_FALSE(cut->solver().is_reduced());
  EXPECT_EQ(cut->solver().patch_size(), 0);
  for (std::size_t i = 1; i < changes.size(); ++i)
    EXPECT_GT(changes[i].tick(), changes[i - 1].tick());
  for (const auto& change : changes)
    EXPECT_NE(log.find(fmt::format("tick {}: solver {}", change.tick(), change.text())),
              std::string::npos)
        << change.tick();

  const auto file = session.journal.string();
  const auto again = recording::verify_journal(file, {}, reduction);
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_EQ(again->verdict(), recording::Verdict::Verified) << again->why();
  EXPECT_GE(again->ticks_verified, 6000u);

  const auto hash = fmt::format("{:016x}", organ::reduction_hash(*made().local));
  auto [code, said] = outcome("trocar-journal", {"info", file}, folder);
  EXPECT_EQ(code, 0);
  EXPECT_NE(said.find("block.reduction (hash " + hash + ")"), std::string::npos) << said;
  std::tie(code, said) = outcome("trocar-journal", {"verify", file}, folder);
  EXPECT_EQ(code, 2);
  EXPECT_NE(said.find("was recorded with the reduction block.reduction (hash " + hash),
            std::string::npos)
      << said;
  EXPECT_EQ(std::ranges::count(said, '\n'), 1) << said;
  const auto other = (folder / "other.reduction").string();
  std::tie(code, said) = outcome("trocar-journal", {"verify", file, "--reduction", other}, folder);
  EXPECT_EQ(code, 3);
  EXPECT_NE(said.find("is another reduction"), std::string::npos) << said;
  EXPECT_NE(said.find(hash), std::string::npos) << said;
}

TEST(ReducedSession, GoesOnWithItsReductionAfterTheServerWasKilled) {
  const auto folder = test_folder();
  write_made(folder);
  const auto reduction = (folder / "block.reduction").string();
  Session session((folder / "block.organ").string(), {"--reduction", reduction});
  auto hand = session.hand("Hand", write_press_script(folder));
  ASSERT_TRUE(session.wait_for_tick(1800)) << "the tool is on the tissue";
  session.server().signal(SIGKILL);
  EXPECT_EQ(session.server().wait(10), 128 + SIGKILL);
  const auto next = (folder / "next.mcap").string();
  std::vector<std::string> arguments{"--resume",  session.journal.string(),
                                     "--listen",  session.address(),
                                     "--journal", next,
                                     "--seconds", "4",
                                     "--pace",    "10"};
  const auto [refused, why] = outcome("trocar-server", arguments, folder);
  EXPECT_EQ(refused, 2);
  EXPECT_NE(why.find("was recorded with the reduction block.reduction"), std::string::npos) << why;
  arguments.insert(arguments.end(),
                   {"--reduction", reduction, "--summary", (folder / "next.json").string()});
  const auto [code, said] = outcome("trocar-server", arguments, folder);
  EXPECT_EQ(code, 0) << said;
  EXPECT_EQ(hand.wait(20), 0) << read_text(folder / "Hand.log");
  const auto summary = read_text(folder / "next.json");
  EXPECT_EQ(json_value(summary, "all_replicas_equal"), "true") << summary;
  EXPECT_EQ(json_number(summary, "ticks"), 4000);
  EXPECT_GT(json_number(summary, "reduced_ticks"), 100);
  const auto verified = recording::verify_journal(next, {}, reduction);
  ASSERT_TRUE(verified.ok()) << verified.error().message;
  EXPECT_EQ(verified->verdict(), recording::Verdict::Verified) << verified->why();
}

TEST(ReducedSession, WithoutAReductionNothingIsAskedFor) {
  const auto folder = test_folder();
  write_made(folder);
  Session session((folder / "block.organ").string(), {"--seconds", "1"});
  ASSERT_EQ(session.server().wait(60), 0);
  EXPECT_TRUE(solver_changes(session.journal).empty());
  EXPECT_EQ(json_value(read_text(folder / "server.json"), "solver"), "null");
  const auto file = session.journal.string();
  auto [code, said] = outcome("trocar-journal", {"verify", file}, folder);
  EXPECT_EQ(code, 0) << said;
  std::tie(code, said) =
      outcome("trocar-journal",
              {"verify", file, "--reduction", (folder / "block.reduction").string()}, folder);
  EXPECT_EQ(code, 2);
  EXPECT_NE(said.find("was recorded without a reduction"), std::string::npos) << said;
}

TEST(ReducedSession, AReductionThatCannotBeUsedIsRefusedInOneLine) {
  const auto folder = test_folder();
  write_made(folder);
  const auto organ = (folder / "block.organ").string();
  const auto reduction = (folder / "block.reduction").string();
  {
    const auto whole = read_text(reduction);
    std::ofstream(folder / "cut.reduction", std::ios::binary) << whole.substr(0, whole.size() / 2);
    ASSERT_TRUE(organ::write_organ(folder / "heavy.organ",
                                   [] {
                                     auto heavy = made().organ;
                                     heavy.material.density_kg_m3 *= 2;
                                     for (auto& mass : heavy.node_masses_kg) mass *= 2;
                                     return heavy;
                                   }())
                    .ok());
  }
  struct Refused {
    std::vector<std::string> arguments;
    const char* says;
  };
  const auto cut = (folder / "cut.reduction").string();
  const auto heavy = (folder / "heavy.organ").string();
  for (const auto& [arguments, says] :
       {Refused{{"--organ", "lattice", "--reduction", reduction}, "can have no reduction"},
        Refused{{"--organ", "liver", "--reduction", reduction}, "is of another mesh"},
        Refused{{"--organ", organ, "--averaged-strain", "--reduction", reduction},
                "leave out --averaged-strain"},
        Refused{{"--organ", organ, "--reduction", cut}, "cut off"},
        Refused{{"--organ", organ, "--reduction", organ}, "is not a .reduction file"},
        Refused{{"--organ", heavy, "--reduction", reduction}, "another density"}}) {
    auto all = arguments;
    all.insert(all.end(), {"--listen", "127.0.0.1:0", "--journal", "none", "--seconds", "1"});
    const auto [code, said] = outcome("trocar-server", all, folder);
    EXPECT_EQ(code, 3) << said;
    EXPECT_NE(said.find(says), std::string::npos) << said;
    EXPECT_EQ(std::ranges::count(said, '\n'), 1) << said;
  }
}

}  // namespace
}  // namespace trocar::e2e
