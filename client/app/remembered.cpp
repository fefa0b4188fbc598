#include "client/app/remembered.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>

#include "common/base/log.h"
#include "common/wire/role.h"

namespace trocar::app {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostNameBytes = 32;

constexpr std::size_t kMostLessons = 200;  // whose points are kept

fs::path file(const char* name) {
  if (const char* folder = std::getenv("XDG_CONFIG_HOME"); folder != nullptr && *folder == '/')
    return fs::path(folder) / "trocar" / name;
  if (const char* home = std::getenv("HOME"); home != nullptr && *home == '/')
    return fs::path(home) / ".config" / "trocar" / name;
  return {};
}

// A line for each lesson: points, a blank, its title.
std::map<std::string, float> read_points() {
  std::map<std::string, float> points;
  std::ifstream stream(file("points"));
  std::string title;
  for (float each = 0; points.size() < kMostLessons && stream >> each;) {
    if (!std::getline(stream >> std::ws, title)) break;
    if (each >= 0 && each <= 100) points[title] = each;
  }
  return points;
}

void write_points(const std::map<std::string, float>& points) {
  const auto path = file("points");
  if (path.empty()) return;
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  std::ofstream stream(path);
  for (const auto& [title, each] : points) stream << each << ' ' << title << '\n';
  stream.close();
  if (!stream) log::debug("{}: points cannot be kept", path.string());
}

}  // namespace

// The first line is the name, the second the role.
std::optional<Person> remembered_person() {
  std::ifstream stream(file("person"));
  std::string name, role_name;
  if (!std::getline(stream, name) || !std::getline(stream, role_name)) return std::nullopt;
  if (name.empty() || name.size() > kMostNameBytes) return std::nullopt;
  for (const auto& known : wire::kRoles)
    if (role_name == known.name) return Person{name, known.role};
  return std::nullopt;
}

void remember(const Person& person) {
  const auto path = file("person");
  if (path.empty()) return;
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  std::ofstream stream(path);
  stream << person.name << '\n' << wire::name_of(person.role) << '\n';
  stream.close();
  if (!stream) log::debug("{}: name and role cannot be kept", path.string());
}

void BestPoints::note(const replica::Replica& replica) {
  const auto& lesson = replica.told().lesson();
  if (!lesson || !lesson->is_over || !replica.own_slot().has_tools()) return;
  if (noted_ == lesson->begin_tick) return;
  noted_ = lesson->begin_tick;
  auto points = read_points();
  const auto known = points.find(lesson->title);
  before_ = known != points.end() ? std::optional(known->second) : std::nullopt;
  if (before_ && *before_ >= lesson->points) return;
  points[lesson->title] = lesson->points;
  write_points(points);
}

}  // namespace trocar::app
