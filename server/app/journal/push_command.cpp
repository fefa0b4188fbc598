#include "server/app/journal/push_command.h"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "common/base/printable.h"
#include "common/base/result.h"
#include "common/command_line/limits.h"
#include "common/journal/mcap_reader.h"
#include "common/journal/recording_end.h"
#include "common/process/memory_file.h"
#include "common/process/process.h"
#include "common/secure/loopback.h"
#include "server/app/journal/program_name.h"
#include "server/app/journal/recordings_of.h"

namespace trocar::app {
namespace {

namespace fs = std::filesystem;

// rclone says a line for each part of a file, of which there are 10,000 at most.
constexpr std::size_t kMostSaid = 4u << 20, kMostReason = 300;
constexpr std::uintmax_t kTakesLong = 16u << 20;  // bytes

// host: a name or an address, one of version 6 in brackets.
bool is_this_machine(std::string host) {
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  return host == "localhost" || secure::is_loopback(host);
}

std::string region_of(const PushCommand& options) {
  if (!options.region.empty()) return options.region;
  for (const auto* name : {"AWS_REGION", "AWS_DEFAULT_REGION"})
    if (const char* text = std::getenv(name); text != nullptr && *text != '\0') return text;
  return "us-east-1";
}

Status check_endpoint(const PushCommand& options) {
  const auto& endpoint = options.endpoint;
  const bool is_plain = endpoint.starts_with("http://");
  const auto host_port =
      endpoint.substr(std::min(endpoint.size(), std::size_t{is_plain ? 7u : 8u}));
  if ((!is_plain && !endpoint.starts_with("https://")) || host_port.empty() ||
      host_port.find_first_of("/@?#'\" ") != std::string::npos)
    return Error{ErrorCode::Usage, "--endpoint: '" + endpoint +
                                       "' is not of the form https://host or https://host:port"};
  const auto host = host_port.substr(
      0, host_port.starts_with('[') ? host_port.find(']') + 1 : host_port.find(':'));
  if (is_plain && !options.allows_plain && !is_this_machine(host))
    return Error{ErrorCode::Usage, endpoint +
                                       ": is another machine without TLS, where recordings can be "
                                       "read on their way: use https://, or give --plain-http"};
  return {};
}

// The destination as rclone reads it. The keys are not in it: rclone takes them from the
// environment.
Result<std::string> destination_of(const PushCommand& options) {
  constexpr std::string_view kScheme = "s3://";
  const auto& url = options.url;
  if (printable(url) != url || url.size() > 1024)
    return Error{ErrorCode::Usage, "URL: is no plain text of 1024 characters at most"};
  if (!url.starts_with(kScheme)) {
    const auto colon = url.find(':');
    if (colon == std::string::npos || url.substr(colon).starts_with("://") || url.starts_with('-'))
      return Error{ErrorCode::Usage, url +
                                         ": is not of the form s3://bucket/prefix, nor REMOTE:path "
                                         "with a remote of rclone (rclone config makes one)"};
    return url;
  }
  const auto path = url.substr(kScheme.size());
  const auto bucket = path.substr(0, path.find('/'));
  if (bucket.size() < 3 || bucket.size() > 63 ||
      bucket.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789.-") != std::string::npos)
    return Error{ErrorCode::Usage,
                 url + ": a bucket has 3 to 63 of the characters a to z, 0 to 9, . and -"};
  if (auto fits = check_endpoint(options); !fits) return fits.error();
  const auto region = region_of(options);
  if (region.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789-") != std::string::npos)
    return Error{ErrorCode::Usage, printable(region, 64) + ": is no name of a region"};
  for (const auto* name : {"AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"})
    if (const char* text = std::getenv(name); text == nullptr || *text == '\0')
      return Error{ErrorCode::Usage, fmt::format("{}: is not set: storage wants a key", name)};
  return fmt::format(
      ":s3,provider=Other,env_auth=true,no_check_bucket=true,endpoint='{}',region={},"
      "chunk_size={}Mi:{}",
      options.endpoint, region, options.part_mb, path);
}

// A file that is still being written would arrive as a part of itself.
Status check_whole(const fs::path& file) {
  const auto reader = journal::McapReader::open(file.string());
  if (!reader) return reader.error();
  if (const auto end = journal::check_counts(**reader); end.status == journal::EndStatus::Wrong)
    return Error{ErrorCode::BadFile, file.string() + ": " + end.text};
  if ((*reader)->is_finished()) return {};
  return Error{ErrorCode::BadFile,
               file.string() +
                   ": is still being written, or was cut short (trocar-journal repair mends it)"};
}

// The reason that stands at the end of what rclone says.
std::string reason_in(const std::string& said) {
  const auto begin = said.rfind("Failed to copy");
  auto reason = begin == std::string::npos ? said : said.substr(begin);
  std::ranges::replace_if(
      reason, [](char c) { return c == '\n' || c == '\t'; }, ' ');
  return printable(reason.substr(0, reason.find_last_not_of(' ') + 1), kMostReason);
}

// name: below the folder that was given, or of the file alone.
Status push_one(const fs::path& file, const fs::path& name, const std::string& destination) {
  if (auto whole = check_whole(file); !whole) return whole;
  const auto folder = fs::absolute(file).parent_path().string();
  auto to = destination;
  if (name.has_parent_path()) {
    if (!to.ends_with('/') && !to.ends_with(':')) to += '/';
    to += name.parent_path().generic_string();
  }
  // rclone looks at what is there only where it brings a folder.
  const process::MemoryFile list(file.filename().string() + "\n"), said;
  process::Command command{.in = list.descriptor(), .errors = said.descriptor()};
  std::istringstream fixed(
      "rclone copy --files-from-raw - --no-traverse --copy-links --immutable --checksum --stats 0 "
      "--log-level DEBUG --retries 1 --low-level-retries 3 --contimeout 10s --timeout 1m --");
  for (std::string word; fixed >> word;) command.words.push_back(word);
  command.words.insert(command.words.end(), {folder, to});
  std::error_code unknown;
  if (const auto bytes = fs::file_size(file, unknown); !unknown && bytes > kTakesLong)
    std::fprintf(stderr, "%s: %.0f MB are on their way\n", name.c_str(),
                 static_cast<double>(bytes) * 1e-6);
  auto child = process::Child::start(command);
  if (!child)
    return Error{child.error().code, child.error().message +
                                         "; it brings recordings to storage: install the package "
                                         "rclone"};
  const auto ending = child->wait();
  const auto text = said.text(kMostSaid);
  // It also ends well where it has found no file of that name to bring.
  const bool is_new = text.find(": Copied (new)") != std::string::npos;
  const bool is_there = text.find(": Unchanged skipping") != std::string::npos;
  if (ending.exit_code == 0 && (is_new || is_there)) {
    std::printf("%s: %s\n", name.c_str(), is_new ? "sent" : "is there");
    std::fflush(stdout);
    return {};
  }
  if (text.find("immutable file modified") != std::string::npos)
    return Error{ErrorCode::Refused,
                 name.string() + ": is there with other content, nothing is ever replaced"};
  for (const auto* word :
       {"AccessDenied", "Forbidden", "SignatureDoesNotMatch", "InvalidAccessKeyId", "NoSuchBucket",
        "status code: 40", "status code: 30"})
    if (text.find(word) != std::string::npos)
      return Error{ErrorCode::Refused,
                   name.string() + ": is not taken: " + reason_in(text) +
                       "; check the keys in the environment, --region, and that the keys may use "
                       "the bucket"};
  return Error{ErrorCode::ResourceMissing,
               name.string() + ": is not sent: " + reason_in(text) +
                   "; check the destination, and give the command again: what is there stays"};
}

}  // namespace

void add_options(CLI::App& command, PushCommand& options) {
  command.add_option("PATH", options.path, "a recording (.mcap), or a folder of them")->required();
  command.add_option("URL", options.url, "s3://bucket/prefix, or REMOTE:path of rclone")
      ->required();
  command
      .add_option("--endpoint", options.endpoint,
                  "address of S3-compatible storage, https://host:port")
      ->type_name("URL");
  command
      .add_option("--region", options.region,
                  "of the storage [AWS_REGION, AWS_DEFAULT_REGION or us-east-1]")
      ->type_name("NAME");
  command.add_option("--part-mb", options.part_mb, "size of a part, in MiB")
      ->check(command_line::whole_from_to(5u, 512u))
      ->capture_default_str();
  command.add_flag("--plain-http", options.allows_plain,
                   "allow http:// to other machines, where recordings can be read on their way");
}

int push(const PushCommand& options) {
  const auto destination = destination_of(options);
  if (!destination) return report(kProgram, destination.error());
  const fs::path root(options.path);
  const auto files = recordings_of(root);
  if (!files) return report(kProgram, files.error());
  const bool is_folder = files->size() != 1 || files->front() != root;
  int code = 0;
  for (const auto& file : *files) {
    const auto name = is_folder ? file.lexically_relative(root) : file.filename();
    const auto pushed = push_one(file, name, *destination);
    if (pushed) continue;
    code = report(kProgram, pushed.error());
    // Another file of the folder may fare better, but not without storage.
    if (pushed.error().code == ErrorCode::ResourceMissing) break;
  }
  return code;
}

}  // namespace trocar::app
