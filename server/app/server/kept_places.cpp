#include "server/app/server/kept_places.h"

#include <algorithm>

#include "common/base/json.h"
#include "common/secure/digest.h"
#include "common/secure/private_files.h"

namespace trocar::app {
namespace {

constexpr int kFileVersion = 1;

}  // namespace

std::filesystem::path places_file(const std::filesystem::path& state_folder, std::uint16_t port) {
  return state_folder / ("places-" + std::to_string(port) + ".json");
}

Status write_places(const std::filesystem::path& file, const std::vector<KeptPlace>& places) {
  Json json = {{"version", kFileVersion}, {"places", Json::array()}};
  for (const auto& place : places)
    json["places"].push_back({{"slot", place.slot.value},
                              {"name", place.name},
                              {"token", secure::to_hex(place.token)},
                              {"code", place.code}});
  return secure::write_private_file(file, to_text(json));
}

Result<std::vector<KeptPlace>> read_places(const std::filesystem::path& file) {
  std::vector<KeptPlace> places;
  if (!std::filesystem::exists(file)) return places;
  const auto text = secure::read_private_file(file);
  if (!text) return text.error();
  const auto bad = [&](const std::string& what) {
    return Error{ErrorCode::BadFile,
                 file.string() + ": is no list of kept seats (" + what + "): remove it"};
  };
  try {
    const auto json = Json::parse(*text);
    if (whole_number<int>(json, "version") != kFileVersion) return bad("another version");
    for (const auto& entry : json.at("places")) {
      KeptPlace place{.slot = {whole_number<std::uint8_t>(entry, "slot")},
                      .name = entry.at("name").get<std::string>()};
      const auto token = secure::from_hex(entry.at("token").get<std::string>());
      if (!place.slot.is_valid() || token.size() != place.token.size()) return bad("a seat");
      std::ranges::copy(token, place.token.begin());
      place.code = whole_number<std::uint32_t>(entry, "code");
      places.push_back(std::move(place));
    }
  } catch (const std::exception& exception) {
    return bad(exception.what());
  }
  return places;
}

}  // namespace trocar::app
