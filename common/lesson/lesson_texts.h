#pragma once

// The lessons that the programs bring: common/lesson/lessons/*.toml, as the build has put them in.

#include <span>
#include <string>
#include <string_view>

namespace trocar::lesson {

struct LessonText {
  std::string name;
  std::string_view text;  // TOML
};
std::span<const LessonText> lesson_texts();  // by name

// Their pictures: common/lesson/lessons/*.jpg.
struct LessonPicture {
  std::string name;
  std::string_view bytes;
};
std::span<const LessonPicture> lesson_pictures();

}  // namespace trocar::lesson
