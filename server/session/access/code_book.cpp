#include "server/session/access/code_book.h"

#include <sys/stat.h>

#include <algorithm>

#include "common/base/json.h"
#include "common/base/log.h"
#include "common/secure/digest.h"
#include "common/secure/private_files.h"

namespace trocar::access {
namespace {

constexpr int kVersion = 1;
constexpr std::size_t kKeyBytes = 32;
constexpr std::size_t kMostCodes = 1000;  // --keep-codes leaves four more at each start

wire::Role role_named(const std::string& name) {
  for (const auto& known : wire::kRoles)
    if (known.name == name) return known.role;
  return wire::Role::Unknown;
}

std::filesystem::path book_file(const std::filesystem::path& folder, std::uint16_t port) {
  return folder / ("codes-" + std::to_string(port) + ".json");
}

Result<Bytes> read_or_make_key(const std::filesystem::path& folder) {
  const auto file = folder / "codes.key";
  if (!std::filesystem::exists(file)) {
    Bytes key(kKeyBytes);
    secure::fill_random(key);
    if (const auto written = secure::write_private_file(file, secure::to_hex(key)); !written)
      return written.error();
    return key;
  }
  const auto text = secure::read_private_file(file);
  if (!text) return text.error();
  auto key = secure::from_hex(*text);
  if (key.size() != kKeyBytes)
    return Error{ErrorCode::BadFile, file.string() + ": is damaged: remove it, codes end with it"};
  return key;
}

Result<CodeEntry> read_entry(const Json& json) {
  CodeEntry entry;
  entry.id = whole_number<std::uint32_t>(json, "id");
  entry.role = role_named(json.at("role").get<std::string>());
  entry.hmac = secure::from_hex(json.at("hmac").get<std::string>());
  entry.expires = whole_number<std::int64_t>(json, "expires");
  entry.uses_left = whole_number<std::int64_t>(json, "uses_left");
  entry.is_revoked = json.at("revoked").get<bool>();
  entry.puts_out = json.at("puts_out").get<bool>();
  if (entry.role == wire::Role::Unknown || entry.hmac.size() != sizeof(secure::Digest))
    return Error{ErrorCode::BadFile, "a code without role or hmac"};
  return entry;
}

}  // namespace

Result<std::vector<CodeEntry>> parse_codes(const std::string& text) {
  std::vector<CodeEntry> entries;
  try {
    const auto json = Json::parse(text);
    if (whole_number<int>(json, "version") != kVersion)
      return Error{ErrorCode::BadFile, "another version"};
    for (const auto& code : json.at("codes")) {
      auto entry = read_entry(code);
      if (!entry) return entry.error();
      entries.push_back(std::move(*entry));
    }
  } catch (const std::exception& exception) {
    return Error{ErrorCode::BadFile, exception.what()};
  }
  if (entries.size() > kMostCodes) return Error{ErrorCode::BadFile, "more than 1000 codes"};
  return entries;
}

CodeBook::CodeBook(std::filesystem::path state_folder, std::uint16_t port, Bytes key)
    : folder_(std::move(state_folder)), file_(book_file(folder_, port)), key_(std::move(key)) {}

Result<CodeBook> CodeBook::open(const std::filesystem::path& state_folder, std::uint16_t port,
                                bool keeps_codes, std::int64_t now) {
  if (const auto made = secure::make_private_folder(state_folder); !made) return made.error();
  const secure::FolderLock lock(state_folder);
  auto key = read_or_make_key(state_folder);
  if (!key) return key.error();
  CodeBook book(state_folder, port, std::move(*key));
  if (keeps_codes && std::filesystem::exists(book.file_)) {
    if (const auto read = book.read(); !read) return read.error();
    std::erase_if(book.entries_, [now](const CodeEntry& entry) {
      return entry.is_revoked || entry.expires <= now || entry.uses_left == 0;
    });
  }
  if (const auto written = book.write(); !written) return written.error();
  return book;
}

Result<CodeBook> CodeBook::open_running(const std::filesystem::path& state_folder,
                                        std::uint16_t port) {
  const auto file = book_file(state_folder, port);
  if (!std::filesystem::exists(file))
    return Error{
        ErrorCode::BadFile,
        file.string() + " is not there: give --listen and --state of the server that runs"};
  const secure::FolderLock lock(state_folder);
  auto key = read_or_make_key(state_folder);
  if (!key) return key.error();
  CodeBook book(state_folder, port, std::move(*key));
  if (const auto read = book.read(); !read) return read.error();
  return book;
}

CodeBook::Stamp CodeBook::stamp() const {
  struct stat status {};
  if (::stat(file_.c_str(), &status) != 0) return {};
  return {status.st_ino, status.st_mtim.tv_sec, status.st_mtim.tv_nsec};
}

Status CodeBook::read() {
  const auto now = stamp();
  const auto text = secure::read_private_file(file_);
  if (!text) return text.error();
  auto entries = parse_codes(*text);
  if (!entries)
    return Error{ErrorCode::BadFile, file_.string() + ": is no list of codes (" +
                                         entries.error().message + "): remove it"};
  entries_ = std::move(*entries);
  read_stamp_ = now;
  return {};
}

Status CodeBook::write() {
  Json json = {{"version", kVersion}, {"codes", Json::array()}};
  for (const auto& entry : entries_)
    json["codes"].push_back({{"id", entry.id},
                             {"role", wire::name_of(entry.role)},
                             {"hmac", secure::to_hex(entry.hmac)},
                             {"expires", entry.expires},
                             {"uses_left", entry.uses_left},
                             {"revoked", entry.is_revoked},
                             {"puts_out", entry.puts_out}});
  const auto written = secure::write_private_file(file_, to_text(json));
  read_stamp_ = stamp();
  return written;
}

Result<secure::HalfCode> CodeBook::issue(wire::Role role, std::int64_t expires, std::int64_t uses) {
  const secure::FolderLock lock(folder_);
  refresh();
  if (entries_.size() >= kMostCodes)
    return Error{ErrorCode::ResourceMissing,
                 file_.string() + ": holds 1000 codes: remove it, or start without --keep-codes"};
  secure::HalfCode secret{};
  secure::fill_random(secret);
  const auto hmac = secure::hmac_sha256(key_, secret);
  CodeEntry entry{.role = role, .expires = expires, .uses_left = uses};
  entry.hmac.assign(hmac.begin(), hmac.end());
  for (const auto& other : entries_) entry.id = std::max(entry.id, other.id);
  ++entry.id;
  entries_.push_back(std::move(entry));
  if (const auto written = write(); !written) return written.error();
  return secret;
}

CodeVerdict CodeBook::check(BytesView secret, std::int64_t now) const {
  const auto hmac = secure::hmac_sha256(key_, secret);
  CodeVerdict verdict;
  // All are compared, each in constant time: how long it takes says nothing about any of them.
  for (const auto& entry : entries_) {
    if (!secure::equal_in_constant_time(entry.hmac, hmac)) continue;
    verdict = {CodeState::Good, entry.id, entry.role};
    if (entry.is_revoked)
      verdict.state = CodeState::Revoked;
    else if (entry.expires <= now)
      verdict.state = CodeState::Expired;
    else if (entry.uses_left == 0)
      verdict.state = CodeState::UsedUp;
  }
  return verdict;
}

bool CodeBook::use(std::uint32_t id) {
  const auto find = [this, id] { return std::ranges::find(entries_, id, &CodeEntry::id); };
  if (const auto found = find(); found == entries_.end() || found->uses_left < 0)
    return found != entries_.end();
  const secure::FolderLock lock(folder_);
  refresh();
  const auto entry = find();
  if (entry == entries_.end() || entry->uses_left == 0) return false;
  --entry->uses_left;
  if (const auto written = write(); !written) log::warn("{}", written.error().message);
  return true;
}

void CodeBook::refresh() {
  if (stamp() == read_stamp_) return;
  if (const auto again = read(); again) return;
  // Whoever damages or removes the file revokes what is in it.
  log::warn("{}: cannot be read any more: all codes are revoked", file_.string());
  entries_.clear();
  read_stamp_ = stamp();
}

void CodeBook::discard() {
  std::error_code ignored;
  std::filesystem::remove(file_, ignored);
}

Result<std::size_t> CodeBook::revoke(const std::string& code_or_role, bool puts_out) {
  const secure::FolderLock lock(folder_);
  refresh();
  const auto role = role_named(code_or_role);
  Bytes hmac;
  if (role == wire::Role::Unknown) {
    const auto invitation = secure::parse_invitation(code_or_role);
    if (!invitation)
      return Error{ErrorCode::Usage, "--revoke: '" + code_or_role +
                                         "' is no join code, link or role: surgeon, assistant, "
                                         "instructor, observer"};
    const auto digest = secure::hmac_sha256(key_, invitation->code.secret);
    hmac.assign(digest.begin(), digest.end());
  }
  std::size_t count = 0;
  for (auto& entry : entries_) {
    const bool is_meant = role != wire::Role::Unknown
                              ? entry.role == role
                              : secure::equal_in_constant_time(entry.hmac, hmac);
    // A code that was revoked may still put out who came with it.
    if (!is_meant || (entry.is_revoked && (entry.puts_out || !puts_out))) continue;
    entry.is_revoked = true;
    entry.puts_out = puts_out;
    ++count;
  }
  if (count == 0)
    return Error{
        ErrorCode::BadFile,
        "--revoke: " + file_.string() +
            ": has no such code that is not revoked yet: check code, --listen and --state"};
  if (const auto written = write(); !written) return written.error();
  return count;
}

bool CodeBook::puts_out(std::uint32_t id) const {
  const auto found = std::ranges::find(entries_, id, &CodeEntry::id);
  return found != entries_.end() && found->puts_out;
}

}  // namespace trocar::access
