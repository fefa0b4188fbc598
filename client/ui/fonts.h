#pragma once

// The fonts of the window's words. They start with the letters of Western Europe; letters of other
// scripts are added as names and sentences with them arrive, from the fonts of this computer that
// fontconfig knows. A letter that no font has stays a question mark, and the log says once per kind
// of script which package has it. Letters stand one after another from the left: the window does
// not join Arabic letters, nor order what is read from the right.
// Thread: render thread, while Dear ImGui has a context.

#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace trocar::ui {

// Names come from outside: no more letters than this are added, beyond the first 255.
inline constexpr std::size_t kMostAddedLetters = 1024;

class Fonts {
 public:
  // `pixels`: the height of a line's letters.
  explicit Fonts(float pixels);

  // Remembers the letters of a UTF-8 text; other bytes are passed over.
  void need(std::string_view text);
  // Makes the fonts again with what need() remembered, between two pictures. True if they changed:
  // the texture on the graphics card is then old.
  bool update();
  // Whether words show this letter; false for those that have become question marks.
  bool has(std::uint32_t letter) const;

 private:
  void load() const;

  float pixels_;
  std::set<std::uint32_t> letters_;  // beyond Latin-1, of the Basic Multilingual Plane
  bool has_new_ = false, is_full_ = false;
  std::set<std::string> missing_packages_;  // that the log has named
  // A font file's letters, as Dear ImGui reads them until the fonts are made: from, to, ..., 0.
  struct Part {
    std::string file;
    int number = 0;  // of the font in the file
    std::vector<unsigned short> ranges;
  };
  std::vector<Part> parts_;
};

}  // namespace trocar::ui
