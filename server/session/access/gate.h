#pragma once

// The gate through which everybody comes who joins: it checks the code of a Hello against the code
// book, bounds wrong tries, and keeps the audit log.
//
//   check -> (the roster finds a place) -> admit -> ... -> note_leave
//        \-> Refusal                    \-> note_refusal
//
// Refusals are said in log and audit log, at most 10 in a second; the next line says how many were
// left out. Thread: the I/O thread.

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "common/base/timing.h"
#include "server/session/access/audit_log.h"
#include "server/session/access/code_book.h"
#include "server/session/access/try_limiter.h"

namespace trocar::access {

enum class RefusalKind { WrongCode, Expired, UsedUp, Revoked, TooManyTries, RoleNotAllowed };

struct Refusal {
  RefusalKind kind = RefusalKind::WrongCode;
  std::string text;  // one line for the person
};

struct Applicant {
  std::string address;
  std::string name;  // as it was sent
  wire::Role role = wire::Role::Unknown;
  std::uint32_t code = 0;  // number in the book once it was found good
  bool relays = false;     // it hands its code on to all who watch
};

struct GateOptions {
  std::function<std::uint64_t()> clock_ns = monotonic_ns;
  std::function<std::int64_t()> unix_seconds;  // empty: the system's clock
};

struct GateCounters {
  std::uint64_t joined = 0, refused = 0, wrong_tries = 0;
};

class Gate {
 public:
  Gate(CodeBook book, std::optional<AuditLog> audit, GateOptions options = {});

  // Returns what `applicant` is refused with, or nothing: then its code is set. has_wrong_token:
  // the applicant has tried to come back to somebody else's place, which counts as a wrong code.
  std::optional<Refusal> check(Applicant& applicant, BytesView secret,
                               bool has_wrong_token = false);
  // Takes one use of the code; false if there is none left.
  bool admit(const Applicant& applicant);

  // Looks at the book's file again, at most once a second; true: it has.
  bool refresh();
  // Whether the host has put out those who came with that code.
  bool puts_out(const Applicant& applicant) const { return book_.puts_out(applicant.code); }

  void note_leave(const Applicant& applicant);
  // `reason` is one line; for refusals by check() and by others alike.
  void note_refusal(const Applicant& applicant, const std::string& reason);
  // `what`: "mark", "return", "lost" (the connection) or "back".
  void note_action(const Applicant& applicant, std::string_view what);

  CodeBook& book() { return book_; }
  const GateCounters& counters() const { return counters_; }

 private:
  void count_wrong_try(const Applicant& applicant, std::uint64_t now_ns);
  void note(std::string_view event, const Applicant& applicant, std::string_view reason = {},
            std::uint64_t left_out = 0);

  CodeBook book_;
  std::optional<AuditLog> audit_;
  const GateOptions options_;
  TryLimiter limiter_;
  std::uint64_t looked_ns_ = 0;  // when the book's file was last looked at
  std::uint64_t said_second_ns_ = 0, left_out_ = 0;
  int said_in_second_ = 0;
  GateCounters counters_;
};

}  // namespace trocar::access
