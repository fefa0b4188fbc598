#include "server/session/access/gate.h"

#include <ctime>

#include "common/base/log.h"
#include "common/base/printable.h"

namespace trocar::access {
namespace {

constexpr int kMostSaidPerSecond = 10;

std::string seconds_text(std::uint64_t seconds) {
  return std::to_string(seconds) + (seconds == 1 ? " second" : " seconds");
}

std::optional<Refusal> refusal_of(CodeState state) {
  switch (state) {
    case CodeState::Good:
      return std::nullopt;
    case CodeState::Expired:
      return Refusal{RefusalKind::Expired,
                     "join code: this code has expired, ask the host for a new one"};
    case CodeState::UsedUp:
      return Refusal{RefusalKind::UsedUp,
                     "join code: this code has been used as often as it may be, ask the host for "
                     "another"};
    case CodeState::Revoked:
      return Refusal{RefusalKind::Revoked,
                     "join code: this code was revoked, ask the host for another"};
    case CodeState::Wrong:
      break;
  }
  return Refusal{RefusalKind::WrongCode,
                 "join code: this server knows no such code, check the last eight characters"};
}

}  // namespace

Gate::Gate(CodeBook book, std::optional<AuditLog> audit, GateOptions options)
    : book_(std::move(book)), audit_(std::move(audit)), options_(std::move(options)) {}

void Gate::count_wrong_try(const Applicant& applicant, std::uint64_t now_ns) {
  ++counters_.wrong_tries;
  limiter_.record_wrong_try(applicant.address, now_ns);
}

std::optional<Refusal> Gate::check(Applicant& applicant, BytesView secret, bool has_wrong_token) {
  const auto now = options_.clock_ns();
  const Refusal none{RefusalKind::WrongCode,
                     "join code: this session wants one, give --join CODE as the host's server "
                     "printed it"};
  if (secret.empty() && !has_wrong_token) return none;
  if (const auto wait = limiter_.seconds_to_wait(applicant.address, now); wait > 0)
    return Refusal{RefusalKind::TooManyTries,
                   "join code: too many wrong codes, try again in " + seconds_text(wait)};
  if (has_wrong_token) count_wrong_try(applicant, now);
  if (secret.empty()) return none;
  book_.refresh();  // a code that has just been revoked admits nobody
  const auto unix_now = options_.unix_seconds ? options_.unix_seconds() : std::time(nullptr);
  const auto verdict = book_.check(secret, unix_now);
  if (verdict.state == CodeState::Wrong) count_wrong_try(applicant, now);
  if (auto refusal = refusal_of(verdict.state)) return refusal;
  if (!wire::rights_of(verdict.role).admits(applicant.role))
    return Refusal{RefusalKind::RoleNotAllowed,
                   std::string("join code: it is one for ") + wire::name_of(verdict.role) +
                       "s and does not make you " + wire::name_of(applicant.role) +
                       ", come with --role " + wire::name_of(verdict.role)};
  if (applicant.relays && verdict.role != wire::Role::Observer)
    return Refusal{RefusalKind::RoleNotAllowed,
                   std::string("join code: it is one for ") + wire::name_of(verdict.role) +
                       "s, and a relay hands its code on to all who watch: give it the "
                       "observer's, with --code"};
  applicant.code = verdict.id;
  return std::nullopt;
}

bool Gate::refresh() {
  const auto now = options_.clock_ns();
  if (now - looked_ns_ < kSecondNs) return false;
  looked_ns_ = now;
  book_.refresh();
  return true;
}

bool Gate::admit(const Applicant& applicant) {
  if (!book_.use(applicant.code)) return false;
  ++counters_.joined;
  note("join", applicant);
  return true;
}

void Gate::note_leave(const Applicant& applicant) {
  note("leave", applicant);
}

void Gate::note_refusal(const Applicant& applicant, const std::string& reason) {
  ++counters_.refused;
  const auto now = options_.clock_ns();
  if (now - said_second_ns_ >= kSecondNs) {
    said_second_ns_ = now;
    said_in_second_ = 0;
  }
  if (said_in_second_ >= kMostSaidPerSecond) {
    ++left_out_;
    return;
  }
  ++said_in_second_;
  log::warn("refused {} ({}) from {}: {}{}", printable(applicant.name, 64),
            wire::name_of(applicant.role), applicant.address, reason,
            left_out_ > 0 ? "; " + std::to_string(left_out_) + " more before it" : std::string());
  note("refusal", applicant, reason, left_out_);
  left_out_ = 0;
}

void Gate::note_action(const Applicant& applicant, std::string_view what) {
  note(what, applicant);
}

void Gate::note(std::string_view event, const Applicant& applicant, std::string_view reason,
                std::uint64_t left_out) {
  if (!audit_) return;
  audit_->write({.event = event,
                 .name = std::string_view(applicant.name).substr(0, 64),
                 .role = wire::name_of(applicant.role),
                 .address = applicant.address,
                 .reason = reason,
                 .code = applicant.code,
                 .left_out = left_out});
}

}  // namespace trocar::access
