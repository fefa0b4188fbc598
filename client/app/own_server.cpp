#include "client/app/own_server.h"

#include <chrono>
#include <fstream>
#include <utility>
#include <vector>

namespace trocar::app {
namespace {

namespace fs = std::filesystem;

constexpr auto kGrace = std::chrono::seconds(15);  // until its recording is whole

}  // namespace

Result<std::unique_ptr<OwnServer>> OwnServer::start(const Settings& settings, const fs::path& log) {
  const std::string address = settings.is_for_network ? "0.0.0.0" : "127.0.0.1";
  std::vector<std::string> words{"setpriv",
                                 "--pdeathsig",
                                 "TERM",
                                 "--",
                                 process::find_program("trocar-server"),
                                 settings.lesson.empty() ? "--organ" : "--lesson",
                                 settings.lesson.empty() ? settings.organ : settings.lesson,
                                 "--listen",
                                 address + ":" + std::to_string(kPort),
                                 "--journal",
                                 settings.recording.empty() ? "none" : settings.recording.string()};
  std::error_code ignored;
  fs::remove(log, ignored);
  auto child = process::Child::start({.words = std::move(words), .log = log});
  if (!child) return child.error();
  return std::unique_ptr<OwnServer>(new OwnServer(std::move(*child), settings, log));
}

OwnServer::~OwnServer() {
  child_.stop(kGrace);
}

std::string OwnServer::last_words() const {
  std::ifstream file(log_);
  std::string line, last;
  while (std::getline(file, line))
    if (!line.empty()) last = line;
  if (last.starts_with("setpriv: ")) last += ": is it beside trocar-client, or on the path?";
  return last.empty() ? "the server has ended without a word" : last;
}

}  // namespace trocar::app
