#include "common/secure/link_file.h"

#include "common/base/json.h"
#include "common/secure/private_files.h"

namespace trocar::secure {
namespace {

std::string file_name(std::uint16_t port) {
  return std::to_string(port) + ".json";
}

Result<JoinCode> code_in(const std::string& text, const std::string& role) {
  try {
    return parse_join_code(Json::parse(text).at("codes").at(role).get<std::string>());
  } catch (const Json::exception&) {
    return Error{ErrorCode::BadFile, "it has no code for the role " + role};
  }
}

}  // namespace

Result<std::filesystem::path> write_link_file(std::uint16_t port, const CodesByRole& codes) {
  Json json = {{"port", port}, {"codes", Json::object()}};
  for (const auto& [role, code] : codes) json["codes"][role] = to_text(code);
  Error why{ErrorCode::ResourceMissing, "neither XDG_RUNTIME_DIR nor HOME is set"};
  for (const auto& folder : link_folders()) {
    const auto path = folder / file_name(port);
    Status done = make_private_folder(folder);
    if (done) done = write_private_file(path, trocar::to_text(json));
    if (done) return path;
    why = done.error();
  }
  return why;
}

Result<JoinCode> read_link_file(std::uint16_t port, const std::string& role) {
  for (const auto& folder : link_folders()) {
    const auto path = folder / file_name(port);
    if (!std::filesystem::exists(path)) continue;
    const auto text = read_private_file(path);
    if (!text) return text.error();
    const auto code = code_in(*text, role);
    if (code) return code;
    return Error{ErrorCode::BadFile, path.string() + ": " + code.error().message +
                                         ": give --join CODE as the server printed it"};
  }
  return Error{ErrorCode::Refused,
               "no join code: the server was not started by you on this machine, so give --join "
               "CODE as its host's screen shows it"};
}

}  // namespace trocar::secure
