#include "server/hall/sessions/state_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <string>

namespace trocar::hall {
namespace {

namespace fs = std::filesystem;

HallState some_state() {
  SavedSession session;
  session.name = "liver-1";
  session.offer = {
      .name = "liver", .lesson = "", .organ = "liver", .cores = 0.4, .workers = 2, .bleeds = true};
  session.folder = "/tmp/recordings/liver-1";
  session.port = 7710;
  session.figures_port = 7730;
  session.recordings = {"session.mcap", "session-2.mcap"};
  session.arguments = {"--listen", "127.0.0.1:7710"};
  session.process = {1234, 987654321};
  session.restarts = 1;
  session.since_unix_s = 1'700'000'000;
  session.codes = {{"surgeon", "7K3M-9QXZ-4T2B-WN8C"}};
  session.peak_cores = 0.75;
  session.busy_windows = 4;
  return {.sessions = {session}, .measured_cores = {{"liver", 0.5}}};
}

TEST(StateFile, IsReadAsItWasWritten) {
  const auto text = to_text(some_state());
  const auto read = parse_state(text, "file");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(to_text(*read), text);
  EXPECT_EQ(read->sessions.at(0).process.started_at, 987654321u);
  EXPECT_EQ(read->measured_cores.at("liver"), 0.5);
  EXPECT_EQ(read->sessions.at(0).offer.cores, 0.4) << "a restarted hall counts it as before";
}

TEST(StateFile, MaySayNothingOfCores) {
  auto state = some_state();
  state.sessions.at(0).offer.cores.reset();
  const auto text = to_text(state);
  EXPECT_EQ(text.find("\"cores\""), std::string::npos);
  const auto read = parse_state(text, "file");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_FALSE(read->sessions.at(0).offer.cores);
}

TEST(StateFile, DamageIsOneLineThatSaysWhatToDo) {
  const auto text = to_text(some_state());
  for (std::size_t length = 0; length + 2 < text.size(); ++length) {
    const auto read = parse_state(std::string_view(text).substr(0, length), "file");
    ASSERT_FALSE(read) << length;
    ASSERT_TRUE(read.error().message.starts_with("file: is damaged"));
  }
  for (const auto& [from, to] : {std::pair{"\"port\": 7710", "\"port\": 77100"},
                                 {"\"version\": 1", "\"version\": 2"},
                                 {"\"pid\": 1234", "\"pid\": 1e99"},
                                 {"\"cores\": 0.4", "\"cores\": -1"},
                                 {"\"name\": \"liver-1\"", "\"name\": \"../1\""}}) {
    auto other = text;
    const auto at = other.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    other.replace(at, std::string(from).size(), to);
    EXPECT_FALSE(parse_state(other, "file")) << to;
  }
}

TEST(StateFile, IsCheckedWithoutAnythingMade) {
  const auto folder = fs::temp_directory_path() / ("trocar-check-" + std::to_string(::getpid()));
  EXPECT_TRUE(StateFile::check(folder));
  EXPECT_FALSE(fs::exists(folder));
  {
    const auto file = StateFile::open(folder);
    ASSERT_TRUE(file) << file.error().message;
    ASSERT_TRUE(file->write(some_state()));
    EXPECT_TRUE(StateFile::check(folder)) << "a hall that runs is in nobody's way";
  }
  fs::permissions(folder, fs::perms::others_read, fs::perm_options::add);
  EXPECT_FALSE(StateFile::check(folder)) << "others may look into it";
  fs::permissions(folder, fs::perms::owner_all);
  std::ofstream(folder / "sessions.json") << "{";
  const auto damaged = StateFile::check(folder);
  ASSERT_FALSE(damaged);
  EXPECT_NE(damaged.error().message.find("is damaged"), std::string::npos);
  const auto file = StateFile::open(folder / "sessions.json");
  ASSERT_FALSE(file) << "it is no folder";
  EXPECT_EQ(file.error().message.find("--state"), std::string::npos) << "a hall has no such option";
  EXPECT_FALSE(StateFile::check(folder / "sessions.json"));
  fs::remove_all(folder);
}

TEST(StateFile, BelongsToOneHallAndToNobodyElse) {
  const auto folder = fs::temp_directory_path() / ("trocar-state-" + std::to_string(::getpid()));
  {
    const auto file = StateFile::open(folder);
    ASSERT_TRUE(file) << file.error().message;
    EXPECT_TRUE(file->read()->sessions.empty());
    ASSERT_TRUE(file->write(some_state()));
    struct stat about {};
    ASSERT_EQ(::stat((folder / "sessions.json").c_str(), &about), 0);
    EXPECT_EQ(about.st_mode & 0777, 0600u) << "join codes stand in it";
    const auto second = StateFile::open(folder);
    ASSERT_FALSE(second);
    EXPECT_NE(second.error().message.find("another trocar-hall"), std::string::npos);
  }
  const auto later = StateFile::open(folder);
  ASSERT_TRUE(later) << "the one before has ended";
  EXPECT_EQ(later->read()->sessions.size(), 1u);
  fs::remove_all(folder);
}

}  // namespace
}  // namespace trocar::hall
