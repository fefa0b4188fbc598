#include "common/discovery/notice.h"

#include <algorithm>
#include <charconv>
#include <set>

#include "common/base/printable.h"

namespace trocar::discovery {
namespace {

int people_of(std::string_view text) {
  int people = 0;
  const auto parsed = std::from_chars(text.data(), text.data() + text.size(), people);
  return parsed.ec == std::errc{} ? std::clamp(people, 0, kMostPeople) : 0;
}

}  // namespace

std::string bounded_text(std::string_view text, std::size_t limit) {
  return printable(text, limit);
}

std::vector<std::string> to_txt(const SessionNotice& notice) {
  return {"organ=" + bounded_text(notice.organ, kMostValueBytes),
          "people=" + std::to_string(std::clamp(notice.people, 0, kMostPeople)),
          std::string("code=") + (notice.needs_code ? "yes" : "no"),
          "protocol=" + bounded_text(notice.protocol, kMostValueBytes)};
}

SessionNotice from_txt(const std::string& name, std::span<const std::string> records) {
  SessionNotice notice{.name = bounded_text(name, kMostNameBytes), .organ = {}, .protocol = {}};
  std::set<std::string> seen;
  for (const auto& record : records) {
    const auto sign = record.find('=');
    if (sign == std::string::npos || !seen.insert(record.substr(0, sign)).second) continue;
    const auto key = record.substr(0, sign), value = record.substr(sign + 1);
    if (key == "organ") notice.organ = bounded_text(value, kMostValueBytes);
    if (key == "people") notice.people = people_of(value);
    if (key == "code") notice.needs_code = value != "no";
    if (key == "protocol") notice.protocol = bounded_text(value, kMostValueBytes);
  }
  return notice;
}

}  // namespace trocar::discovery
