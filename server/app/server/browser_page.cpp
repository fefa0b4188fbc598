#include "server/app/server/browser_page.h"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <thread>
#include <utility>
#include <vector>

#include "common/base/log.h"
#include "common/process/memory_file.h"
#include "common/secure/loopback.h"

namespace trocar::app {
namespace {

using std::chrono::milliseconds;
constexpr milliseconds kPoll{20}, kStartDeadline{15'000}, kGoodbye{1500}, kWatchPeriod{2000};
constexpr std::size_t kMostLinkBytes = 256 * 1024;
constexpr const char* kProgram = "trocar-web";

std::string bracketed(const std::string& address) {
  return address.find(':') == std::string::npos ? address : "[" + address + "]";
}

// Returns where the page's program reaches a server that listens at that address.
std::string reached_at(const std::string& address) {
  if (address == "0.0.0.0") return "127.0.0.1";
  return address == "::" ? "[::1]" : bracketed(address);
}

std::vector<std::string> command_of(const ServerOptions& options, std::uint16_t port) {
  const auto& page = options.page_address.empty() ? options.address : options.page_address;
  std::vector<std::string> words{
      "setpriv",      "--pdeathsig",
      "TERM",         process::find_program(kProgram),
      "--session",    fmt::format("{}:{}", reached_at(options.address), port),
      "--listen",     fmt::format("{}:{}", bracketed(page), options.page_port),
      "--ready-file", "/proc/self/fd/3",
      "--log-level",  options.log_level,
      "--log-format", options.log_format};
  const auto add = [&words](const char* option, const std::string& value) {
    if (!value.empty()) words.insert(words.end(), {option, value});
  };
  const auto& access = options.access;
  add("--state", access.state_folder);
  const bool is_near = secure::is_loopback(page);
  if (is_near) {
    words.emplace_back("--insecure-loopback");
  } else {
    add("--certificate", access.certificate_file);
    add("--key", access.key_file);
    if (::isatty(STDOUT_FILENO) == 1) words.emplace_back("--qr");
  }
  return words;
}

}  // namespace

Status BrowserPage::check(const ServerOptions& options) {
  if (options.access.is_insecure)
    return Error{
        ErrorCode::Usage,
        "--browser: links hold join codes, and --insecure-loopback has none: leave it out"};
  const auto program = process::find_program(kProgram);
  if (program.find('/') != std::string::npos && ::access(program.c_str(), X_OK) == 0) return {};
  return Error{
      ErrorCode::ResourceMissing,
      "--browser: trocar-web is not beside trocar-server: install its package, or build it "
      "with deploy/build --with-web"};
}

Result<std::unique_ptr<BrowserPage>> BrowserPage::start(asio::io_context& context,
                                                        const ServerOptions& options,
                                                        std::uint16_t port) {
  if (!options.has_page) return std::unique_ptr<BrowserPage>();
  if (const auto fine = check(options); !fine) return fine.error();
  const process::MemoryFile links, ready;
  auto child = process::Child::start({.words = command_of(options, port),
                                      .out = links.descriptor(),
                                      .errors = STDERR_FILENO,
                                      .more = ready.descriptor(),
                                      .is_apart = true});
  if (!child) return Error{child.error().code, "--browser: " + child.error().message};
  const auto until = std::chrono::steady_clock::now() + kStartDeadline;
  while (ready.text(1).empty()) {
    if (child->poll() || std::chrono::steady_clock::now() > until)
      return Error{ErrorCode::ResourceMissing,
                   "--browser: the page was not started, its reason stands above; "
                   "--browser-listen names another port"};
    std::this_thread::sleep_for(kPoll);
  }
  std::unique_ptr<BrowserPage> page(
      new BrowserPage(context, std::move(*child), links.text(kMostLinkBytes)));
  page->watch();
  return page;
}

void BrowserPage::watch() {
  if (child_.poll())
    return log::error("the page for browsers has ended: others go on; trocar-web starts it again");
  timer_.expires_after(kWatchPeriod);
  timer_.async_wait([this](boost::system::error_code error) {
    if (!error) watch();
  });
}

void BrowserPage::stop() {
  timer_.cancel();
  child_.stop(kGoodbye);
}

}  // namespace trocar::app
