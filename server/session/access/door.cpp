#include "server/session/access/door.h"

#include <algorithm>

namespace trocar::access {
namespace {

template <typename Entry>
void push_bounded(std::vector<Entry>& list, Entry entry, std::size_t most) {
  if (list.size() >= most) list.erase(list.begin());
  list.push_back(std::move(entry));
}

}  // namespace

void Door::put_out(const Applicant& who) {
  std::erase(admitted_, who.name);
  push_bounded(put_out_, PutOut{who.code, who.code == 0 ? who.name : std::string()}, kMostPutOut);
}

bool Door::admit(const std::string& name) {
  if (std::erase(waiting_, name) == 0) return false;
  push_bounded(admitted_, name, kMostAdmitted);
  return true;
}

bool Door::is_put_out(const Applicant& who) const {
  return std::ranges::any_of(put_out_, [&](const PutOut& entry) {
    return entry.code == 0 ? entry.name == who.name : entry.code == who.code;
  });
}

std::optional<std::string> Door::check(const Applicant& who) {
  if (std::ranges::find(admitted_, who.name) != admitted_.end()) return std::nullopt;
  const bool is_put_out_before = is_put_out(who);
  const bool has_to_wait = is_closed_ && who.role != wire::Role::Instructor;
  if (!is_put_out_before && !has_to_wait) return std::nullopt;
  if (std::ranges::find(waiting_, who.name) == waiting_.end())
    push_bounded(waiting_, who.name, kMostWaiting);
  return is_put_out_before
             ? "an instructor has put out somebody with this join code: the instructor sees that "
               "you wait, try again in a moment"
             : "the session is closed to newcomers: the instructor sees that you wait, try again "
               "in a moment";
}

void Door::note_entry(const std::string& name) {
  std::erase(admitted_, name);
  std::erase(waiting_, name);
}

}  // namespace trocar::access
