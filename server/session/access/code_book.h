#pragma once

// The join codes of one server, in a file of its state folder: of each secret an HMAC-SHA256 under
// a key that lies in another file, with role, end, uses left and whether it is revoked. Who has
// stolen the file of codes alone can neither join with it nor find a secret.
//
//   codes-PORT.json   {"version": 1, "codes": [{"id", "role", "hmac", "expires", "uses_left",
//                     "revoked", "puts_out"}]}: `expires` in seconds of Unix time, `uses_left` -1
//                     without limit, `puts_out`: who came with it has to go
//   codes.key         32 random bytes as hexadecimal digits
//
// The file may be changed meanwhile (trocar-server --revoke, --new-code): it is looked at again at
// most once a second. Every change is made under the folder's lock, of what the file says then.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/secure/join_code.h"
#include "common/wire/role.h"

namespace trocar::access {

struct CodeEntry {
  std::uint32_t id = 0;
  wire::Role role = wire::Role::Observer;
  Bytes hmac;
  std::int64_t expires = 0;
  std::int64_t uses_left = -1;
  bool is_revoked = false;
  bool puts_out = false;  // likewise, and who came with it has to go
};

// Reads the text of a book's file.
Result<std::vector<CodeEntry>> parse_codes(const std::string& text);

enum class CodeState { Good, Wrong, Expired, UsedUp, Revoked };

struct CodeVerdict {
  CodeState state = CodeState::Wrong;
  std::uint32_t id = 0;                   // of the code, unless it is wrong
  wire::Role role = wire::Role::Unknown;  // likewise
};

class CodeBook {
 public:
  // Opens the book of one server's port. Without `keeps_codes` what an earlier run left is dropped,
  // else what is still good stays so.
  static Result<CodeBook> open(const std::filesystem::path& state_folder, std::uint16_t port,
                               bool keeps_codes, std::int64_t now);

  // Opens the book of the server that runs at that port, to change it.
  static Result<CodeBook> open_running(const std::filesystem::path& state_folder,
                                       std::uint16_t port);

  // A new code's secret. `uses` -1: without limit.
  Result<secure::HalfCode> issue(wire::Role role, std::int64_t expires, std::int64_t uses);
  CodeVerdict check(BytesView secret, std::int64_t now) const;
  // Revokes a code, or all of a role; returns how many that were. `puts_out`: see CodeEntry.
  Result<std::size_t> revoke(const std::string& code_or_role, bool puts_out);
  // Whether who came with this code has to go.
  bool puts_out(std::uint32_t id) const;
  // Takes one use of a code; says whether there was one.
  bool use(std::uint32_t id);
  // Reads the file again if it is not the one that was read last.
  void refresh();
  // Removes the file.
  void discard();

  const std::vector<CodeEntry>& entries() const { return entries_; }

 private:
  CodeBook(std::filesystem::path state_folder, std::uint16_t port, Bytes key);

  struct Stamp {
    std::uint64_t inode = 0;
    std::int64_t seconds = 0, nanoseconds = 0;
    bool operator==(const Stamp&) const = default;
  };
  Stamp stamp() const;
  Status read();
  Status write();

  std::filesystem::path folder_, file_;
  Bytes key_;
  std::vector<CodeEntry> entries_;
  Stamp read_stamp_;
};

}  // namespace trocar::access
