#include "server/app/journal/push_command.h"

#include <unistd.h>

#include <CLI/CLI.hpp>

#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "common/base/printable.h"
#include "common/base/result.h"
#include "common/command_line/limits.h"
#include "common/journal/mcap_reader.h"
#include "common/journal/recording_end.h"
#include "server/app/journal/program_name.h"
#include "server/app/journal/recordings_of.h"
#include "server/session/archive/push.h"

namespace trocar::app {
namespace {

namespace fs = std::filesystem;

std::string region_of(const PushCommand& options) {
  if (!options.region.empty()) return options.region;
  for (const auto* name : {"AWS_REGION", "AWS_DEFAULT_REGION"})
    if (const char* text = std::getenv(name); text != nullptr && *text != '\0') return text;
  return "us-east-1";
}

Result<std::unique_ptr<archive::S3Client>> client_of(const PushCommand& options) {
  auto place = archive::read_place(options.url, options.endpoint, options.allows_plain);
  if (!place) return place.error();
  place->region = region_of(options);
  if (place->region.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789-") != std::string::npos)
    return Error{ErrorCode::Usage, printable(place->region, 64) + ": is no name of a region"};
  auto credentials = archive::credentials_of_environment();
  if (!credentials) return credentials.error();
  return archive::S3Client::create(std::move(*place), std::move(*credentials));
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

Status push_one(archive::S3Client& client, const fs::path& file, const std::string& key,
                const PushCommand& options) {
  if (auto whole = check_whole(file); !whole) return whole;
  const bool is_terminal = ::isatty(STDERR_FILENO) != 0;
  const auto pushed = archive::push_file(
      client, file.string(), key,
      {.part_bytes = std::uint64_t{options.part_mb} << 20,
       .progress = [&](std::uint64_t sent, std::uint64_t of) {
         if (is_terminal)
           std::fprintf(stderr, "\r%s: %" PRIu64 " of %" PRIu64 " parts", kProgram, sent, of);
       }});
  if (is_terminal) std::fprintf(stderr, "\n");
  if (!pushed) return pushed.error();
  if (pushed->was_there)
    std::printf("%s: is there, %" PRIu64 " bytes, sha256 %s\n", key.c_str(), pushed->bytes,
                pushed->sha256.c_str());
  else
    std::printf("%s: %" PRIu64 " bytes in %" PRIu64 " parts, %" PRIu64
                " of them were there, sha256 %s\n",
                key.c_str(), pushed->bytes, pushed->parts_sent + pushed->parts_there,
                pushed->parts_there, pushed->sha256.c_str());
  std::fflush(stdout);
  return {};
}

}  // namespace

void add_options(CLI::App& command, PushCommand& options) {
  command.add_option("PATH", options.path, "a recording (.mcap), or a folder of them")->required();
  command.add_option("URL", options.url, "s3://bucket/prefix")->required();
  command.add_option("--endpoint", options.endpoint, "address of the storage, https://host:port")
      ->type_name("URL")
      ->required();
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
  auto client = client_of(options);
  if (!client) return report(kProgram, client.error());
  const fs::path root(options.path);
  const auto files = recordings_of(root);
  if (!files) return report(kProgram, files.error());
  const bool is_folder = files->size() != 1 || files->front() != root;
  int code = 0;
  for (const auto& file : *files) {
    const auto name = is_folder ? file.lexically_relative(root) : file.filename();
    const auto key = archive::object_key((*client)->place().prefix, name.generic_string());
    const auto pushed = push_one(**client, file, key, options);
    if (pushed) continue;
    code = report(kProgram, pushed.error());
    // Another file of the folder may fare better, but not without storage.
    if (pushed.error().code == ErrorCode::ResourceMissing) break;
  }
  return code;
}

}  // namespace trocar::app
