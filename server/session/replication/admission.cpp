#include "server/session/replication/admission.h"

#include <algorithm>

#include "common/intake/room.h"

namespace trocar::replication {
namespace {

EndReason reason_of(participants::JoinRefusal refusal, participants::Role role) {
  switch (refusal) {
    case participants::JoinRefusal::NameInvalid:
      return EndReason::NameInvalid;
    case participants::JoinRefusal::NameTaken:
      return EndReason::NameTaken;
    case participants::JoinRefusal::Full:
      return EndReason::Full;
    case participants::JoinRefusal::ToolsInvalid:
      return participants::has_tools(role) ? EndReason::ProtocolError : EndReason::Role;
  }
  return EndReason::Unspecified;
}

EndReason reason_of(access::RefusalKind refusal) {
  switch (refusal) {
    case access::RefusalKind::WrongCode:
      return EndReason::CodeWrong;
    case access::RefusalKind::Expired:
      return EndReason::CodeExpired;
    case access::RefusalKind::UsedUp:
      return EndReason::CodeUsedUp;
    case access::RefusalKind::Revoked:
      return EndReason::CodeRevoked;
    case access::RefusalKind::TooManyTries:
      return EndReason::TooManyTries;
    case access::RefusalKind::RoleNotAllowed:
      return EndReason::CodeRole;
  }
  return EndReason::Unspecified;
}

}  // namespace

std::optional<Ending> Admission::admit(Speaker& who, HelloRequest& request) {
  if (auto ending = check(who, request)) return ending;
  if (auto ending = find_place(who, request)) return ending;
  const auto slot = who.participant->slot;
  auto* gate = session_.options.gate;
  if (gate && !gate->admit(who.applicant)) {
    if (slot.has_tools()) session_.inbox.push_leave(slot);
    session_.roster.leave(slot);
    who.participant.reset();
    return Ending{EndReason::CodeUsedUp, "join code: somebody has just taken its last use"};
  }
  door_.note_entry(request.name);
  if (request.can_return) absences_.issue(slot);
  return std::nullopt;
}

std::optional<Ending> Admission::check(Speaker& who, const HelloRequest& request) {
  if (auto* gate = session_.options.gate) {
    const bool has_wrong_token =
        !request.return_token.empty() && session_.roster.find(request.name) != nullptr;
    if (const auto refusal = gate->check(who.applicant, request.join_secret, has_wrong_token))
      return Ending{reason_of(refusal->kind), refusal->text};
  }
  if (!participants::is_valid_name(request.name)) return std::nullopt;  // the roster says so
  if (const auto wait = door_.check(who.applicant)) {
    session_.is_told = false;  // it is seen who waits
    return Ending{EndReason::Closed, *wait};
  }
  return std::nullopt;
}

// Who got hold of one code does not take all places with it. Observers whom a carrier brings share
// its address, and are not counted.
bool Admission::has_too_many_alike(const Speaker& who) const {
  const auto role = who.applicant.role;
  const auto is_counted = [](const Speaker& one) {
    return !one.is_guest || one.applicant.role == participants::Role::Instructor;
  };
  if (!session_.options.gate || !is_counted(who) || participants::has_tools(role)) return false;
  const auto is_alike = [&](const participants::Participant& one) {
    const auto* other = session_.audience.find(one.slot);
    return other && !one.is_away && is_counted(*other) && one.role == role &&
           other->applicant.code == who.applicant.code &&
           intake::counted_as(other->applicant.address) ==
               intake::counted_as(who.applicant.address);
  };
  return std::ranges::count_if(session_.roster.list(), is_alike) >=
         participants::places_alike(role, session_.options.places);
}

std::optional<Ending> Admission::find_place(Speaker& who, HelloRequest& request) {
  if (has_too_many_alike(who))
    return Ending{
        EndReason::Full,
        "full: " +
            std::to_string(participants::places_alike(request.role, session_.options.places)) +
            " " + participants::name_of(request.role) +
            "s with this code are here from your address, come back later"};
  auto refusal = participants::JoinRefusal::Full;
  auto joined = session_.roster.join(request.name, request.role, std::move(request.tools), refusal);
  if (!joined) return Ending{reason_of(refusal, request.role), joined.error().message};
  if (joined->slot.has_tools()) {
    hands::HandJoin join{joined->slot, static_cast<int>(joined->tools.size()), {}};
    std::copy(joined->tools.begin(), joined->tools.end(), join.shapes.begin());
    if (!session_.inbox.try_push_join(join)) {
      session_.roster.leave(joined->slot);
      return Ending{EndReason::Full, "the server is busy: try again in a second"};
    }
  }
  who.participant = std::move(*joined);
  return std::nullopt;
}

}  // namespace trocar::replication
