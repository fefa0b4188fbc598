// Who gets in, with the real programs: codes and links as they are printed, the link file, --revoke
// and --keep-codes.

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>

#include "tests/e2e/programs.h"

namespace trocar::e2e {
namespace {

namespace fs = std::filesystem;

unsigned mode_of(const fs::path& path) {
  struct stat status {};
  return ::stat(path.c_str(), &status) == 0 ? status.st_mode & 0777u : 0u;
}

class Access : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = test_folder();
    if (const char* before = std::getenv("XDG_RUNTIME_DIR")) runtime_before_ = before;
    ::setenv("XDG_RUNTIME_DIR", (folder_ / "run").c_str(), 1);
    fs::create_directories(folder_ / "run");
  }
  void TearDown() override {
    if (runtime_before_.empty())
      ::unsetenv("XDG_RUNTIME_DIR");
    else
      ::setenv("XDG_RUNTIME_DIR", runtime_before_.c_str(), 1);
    fs::remove_all(folder_);
  }

  Program start_server(const std::string& listen, std::vector<std::string> extra = {}) {
    fs::remove(folder_ / "ready");
    std::vector<std::string> arguments{
        "--organ", "lattice", "--journal",      "none",         "--listen",
        listen,    "--state", state().string(), "--ready-file", (folder_ / "ready").string()};
    arguments.insert(arguments.end(), extra.begin(), extra.end());
    Program server("trocar-server", arguments, log());
    EXPECT_TRUE(
        wait_until([&] { return read_text(log()).find("observer ") != std::string::npos; }, 60))
        << read_text(log());
    port_ = read_text(folder_ / "ready");
    port_.erase(port_.find_last_not_of(" \n") + 1);
    return server;
  }
  int join(std::vector<std::string> arguments) {
    for (const char* more : {"--no-render", "--seconds", "0.2", "--wait", "20"})
      arguments.push_back(more);
    Program client("trocar-client", arguments, folder_ / "client.log");
    return client.wait(40);
  }
  std::string said() const { return read_text(folder_ / "client.log"); }
  fs::path state() const { return folder_ / "state"; }
  fs::path log() const { return folder_ / "server.log"; }
  std::string address() const { return "127.0.0.1:" + port_; }
  Invitation invitation(const std::string& role) const { return find_invitation(log(), role); }

  fs::path folder_;
  std::string port_, runtime_before_;
};

TEST_F(Access, PrintedCodesAndLinksLetInAndOthersDoNot) {
  auto server = start_server("127.0.0.1:0");
  const auto surgeon = invitation("surgeon"), observer = invitation("observer");
  EXPECT_EQ(surgeon.link, "trocar://" + address() + "/" + surgeon.code);
  EXPECT_EQ(join({"--join", surgeon.link, "--name", "Ada"}), 0) << said();
  EXPECT_EQ(join({"--join", observer.code, "--server", address(), "--role", "observer"}), 0)
      << said();
  EXPECT_EQ(join({"--server", address(), "--name", "Here"}), 0) << "the link file: " << said();
  EXPECT_EQ(join({"--join", observer.code, "--server", address()}), 4);
  EXPECT_NE(said().find("--role observer"), std::string::npos) << said();
  auto wrong = surgeon.code;
  wrong.back() = wrong.back() == '0' ? '2' : '0';
  EXPECT_EQ(join({"--join", wrong, "--server", address()}), 4);
  EXPECT_NE(said().find("no such code"), std::string::npos) << said();
  wrong = surgeon.code;
  wrong.front() = wrong.front() == '0' ? '2' : '0';
  EXPECT_EQ(join({"--join", wrong, "--server", address()}), 4);
  EXPECT_NE(said().find("nothing was sent"), std::string::npos) << said();
  EXPECT_EQ(join({"--server", address(), "--insecure-loopback"}), 4);
  EXPECT_NE(said().find("TLS"), std::string::npos) << said();
  EXPECT_EQ(join({"--join", "7K3M", "--server", address()}), 2);
  EXPECT_EQ(join({"--server", "192.0.2.1:7690"}), 2) << "another machine wants --join";
  EXPECT_EQ(join({"--server", "192.0.2.1:7690", "--insecure-loopback"}), 2);
  server.signal(SIGTERM);
  EXPECT_EQ(server.wait(20), 0);
}

TEST_F(Access, FilesArePrivateAndCodesGoWithTheServer) {
  auto server = start_server("127.0.0.1:0");
  EXPECT_EQ(mode_of(state()), 0700u);
  for (const auto* name : {"server.key", "server.crt", "codes.key", "audit.jsonl"})
    EXPECT_EQ(mode_of(state() / name), 0600u) << name;
  const auto codes = state() / ("codes-" + port_ + ".json");
  const auto link = folder_ / "run" / "trocar" / (port_ + ".json");
  EXPECT_EQ(mode_of(codes), 0600u);
  EXPECT_EQ(mode_of(link), 0600u);
  EXPECT_EQ(mode_of(link.parent_path()), 0700u);
  server.signal(SIGTERM);
  EXPECT_EQ(server.wait(20), 0);
  EXPECT_FALSE(fs::exists(codes));
  EXPECT_FALSE(fs::exists(link));
}

TEST_F(Access, RevokedCodesRefuseAndKeptCodesOutliveTheServer) {
  std::string watcher, surgeon;
  {
    auto server = start_server("127.0.0.1:0", {"--keep-codes"});
    watcher = invitation("observer").code;
    surgeon = invitation("surgeon").code;
    Program revoke("trocar-server",
                   {"--listen", address(), "--state", state().string(), "--revoke", "observer"},
                   folder_ / "revoke.log");
    EXPECT_EQ(revoke.wait(10), 0) << read_text(folder_ / "revoke.log");
    EXPECT_EQ(join({"--join", watcher, "--server", address(), "--role", "observer"}), 4);
    EXPECT_NE(said().find("revoked"), std::string::npos) << said();
    Program again("trocar-server",
                  {"--listen", address(), "--state", state().string(), "--new-code", "observer"},
                  folder_ / "again.log");
    EXPECT_EQ(again.wait(10), 0) << read_text(folder_ / "again.log");
    const auto link = find_invitation(folder_ / "again.log", "observer").link;
    // The server looks at its codes once a second.
    EXPECT_TRUE(wait_until(
        [&] {
          return join({"--join", link, "--role", "observer"}) == 0;
        },
        20))
        << said();
    server.signal(SIGTERM);
    EXPECT_EQ(server.wait(20), 0);
  }
  auto server = start_server(address(), {"--keep-codes"});
  EXPECT_NE(invitation("surgeon").code, surgeon);
  EXPECT_EQ(join({"--join", surgeon, "--server", address()}), 0) << said();
  EXPECT_EQ(join({"--join", watcher, "--server", address(), "--role", "observer"}), 4);
}

}  // namespace
}  // namespace trocar::e2e
