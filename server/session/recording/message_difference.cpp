#include "server/session/recording/message_difference.h"

#include <google/protobuf/message.h>
#include <google/protobuf/util/message_differencer.h>

#include <sstream>
#include <string_view>

namespace trocar::recording {
namespace {

constexpr std::size_t kMostText = 200;
constexpr std::string_view kNothing = "nothing";

// One line of the differencer: "modified: tool[0].force_n.x: 1.5 -> 1.25".
std::optional<FieldDifference> read_line(std::string_view line) {
  const auto kind_end = line.find(": ");
  if (kind_end == line.npos) return std::nullopt;
  const auto kind = line.substr(0, kind_end);
  const auto rest = line.substr(kind_end + 2);
  const auto path_end = rest.find(": ");
  if (path_end == rest.npos) return std::nullopt;
  const std::string field(rest.substr(0, path_end));
  const auto values = rest.substr(path_end + 2);
  const auto shortened = [](std::string_view text) {
    return std::string(text.substr(0, kMostText));
  };
  if (kind == "added") return FieldDifference{field, std::string(kNothing), shortened(values)};
  if (kind == "deleted") return FieldDifference{field, shortened(values), std::string(kNothing)};
  const auto arrow = values.find(" -> ");
  if (arrow == values.npos) return FieldDifference{field, shortened(values), ""};
  return FieldDifference{field, shortened(values.substr(0, arrow)),
                         shortened(values.substr(arrow + 4))};
}

}  // namespace

std::optional<FieldDifference> first_difference(const google::protobuf::Message& recorded,
                                                const google::protobuf::Message& simulated,
                                                bool is_older) {
  if (recorded.SerializeAsString() == simulated.SerializeAsString()) return std::nullopt;
  std::string differences;
  google::protobuf::util::MessageDifferencer differencer;
  differencer.ReportDifferencesToString(&differences);
  if (differencer.Compare(recorded, simulated)) return std::nullopt;
  std::istringstream lines(differences);
  std::string line;
  while (std::getline(lines, line)) {
    if (is_older && line.starts_with("added: ")) continue;
    if (auto difference = read_line(line)) return difference;
  }
  if (is_older) return std::nullopt;
  return FieldDifference{"message", differences.substr(0, kMostText), ""};
}

}  // namespace trocar::recording
