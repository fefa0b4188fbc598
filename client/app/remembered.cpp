#include "client/app/remembered.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "common/base/log.h"
#include "common/wire/role.h"

namespace trocar::app {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostNameBytes = 32;

fs::path file() {
  if (const char* folder = std::getenv("XDG_CONFIG_HOME"); folder != nullptr && *folder == '/')
    return fs::path(folder) / "trocar" / "person";
  if (const char* home = std::getenv("HOME"); home != nullptr && *home == '/')
    return fs::path(home) / ".config" / "trocar" / "person";
  return {};
}

}  // namespace

// The first line is the name, the second the role.
std::optional<Person> remembered_person() {
  std::ifstream stream(file());
  std::string name, role_name;
  if (!std::getline(stream, name) || !std::getline(stream, role_name)) return std::nullopt;
  if (name.empty() || name.size() > kMostNameBytes) return std::nullopt;
  for (const auto& known : wire::kRoles)
    if (role_name == known.name) return Person{name, known.role};
  return std::nullopt;
}

void remember(const Person& person) {
  const auto path = file();
  if (path.empty()) return;
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  std::ofstream stream(path);
  stream << person.name << '\n' << wire::name_of(person.role) << '\n';
  stream.close();
  if (!stream) log::debug("{}: name and role cannot be kept", path.string());
}

}  // namespace trocar::app
