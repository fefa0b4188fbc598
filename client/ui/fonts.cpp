#include "client/ui/fonts.h"

#include <fontconfig/fontconfig.h>
#include <imgui.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>

#include "common/base/log.h"
#include "common/base/printable.h"

namespace trocar::ui {
namespace {

constexpr const char* kFont = "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf";
constexpr const char* kBoldFont = "/usr/share/fonts/truetype/dejavu/DejaVuSans-Bold.ttf";
constexpr float kDefaultShare = 13.0f / 14;  // Dear ImGui's own font is meant for 13 pixels

struct FontFile {
  std::string path;
  int number = 0;
};

// A font of this computer that has the letter, DejaVu Sans if it can be.
std::optional<FontFile> find_font(std::uint32_t letter) {
  const std::unique_ptr<FcPattern, decltype(&FcPatternDestroy)> pattern(FcPatternCreate(),
                                                                        FcPatternDestroy);
  const std::unique_ptr<FcCharSet, decltype(&FcCharSetDestroy)> letters(FcCharSetCreate(),
                                                                        FcCharSetDestroy);
  FcCharSetAddChar(letters.get(), letter);
  FcPatternAddCharSet(pattern.get(), FC_CHARSET, letters.get());
  FcPatternAddString(pattern.get(), FC_FAMILY, reinterpret_cast<const FcChar8*>("DejaVu Sans"));
  FcPatternAddBool(pattern.get(), FC_SCALABLE, FcTrue);
  FcPatternAddBool(pattern.get(), FC_COLOR, FcFalse);
  FcPatternAddBool(pattern.get(), FC_VARIABLE, FcFalse);
  FcConfigSubstitute(nullptr, pattern.get(), FcMatchPattern);
  FcDefaultSubstitute(pattern.get());
  FcResult result{};
  const std::unique_ptr<FcPattern, decltype(&FcPatternDestroy)> match(
      FcFontMatch(nullptr, pattern.get(), &result), FcPatternDestroy);
  FcCharSet* has = nullptr;
  FcChar8 *file = nullptr, *format = nullptr;
  FontFile found;
  if (match == nullptr || FcPatternGetCharSet(match.get(), FC_CHARSET, 0, &has) != FcResultMatch ||
      FcCharSetHasChar(has, letter) == FcFalse ||
      FcPatternGetString(match.get(), FC_FILE, 0, &file) != FcResultMatch ||
      FcPatternGetInteger(match.get(), FC_INDEX, 0, &found.number) != FcResultMatch ||
      FcPatternGetString(match.get(), FC_FONTFORMAT, 0, &format) != FcResultMatch)
    return std::nullopt;
  // Dear ImGui draws the outlines of these two kinds.
  const std::string_view kind = reinterpret_cast<const char*>(format);
  if ((kind != "TrueType" && kind != "CFF") || found.number < 0 || found.number > 0xffff)
    return std::nullopt;
  found.path = reinterpret_cast<const char*>(file);
  return found;
}

// The package of Debian that has letters of this kind.
const char* package_with(std::uint32_t letter) {
  const bool is_east_asian =
      (letter >= 0x1100 && letter <= 0x11ff) || (letter >= 0x2e80 && letter <= 0xd7ff) ||
      (letter >= 0xf900 && letter <= 0xfaff) || (letter >= 0xff00 && letter <= 0xffef);
  if (is_east_asian) return "fonts-noto-cjk";
  return letter < 0x700 ? "fonts-dejavu-core" : "fonts-noto-core";
}

}  // namespace

Fonts::Fonts(float pixels) : pixels_(pixels) {
  load();
}

void Fonts::load() const {
  ImFontAtlas& atlas = *ImGui::GetIO().Fonts;
  atlas.Clear();
  if (!std::filesystem::exists(kFont) || !std::filesystem::exists(kBoldFont)) {
    ImFontConfig config;
    config.SizePixels = pixels_ * kDefaultShare;
    atlas.AddFontDefault(&config);
    return;
  }
  for (const char* file : {kFont, kBoldFont}) {
    atlas.AddFontFromFileTTF(file, pixels_);
    for (const Part& part : parts_) {
      ImFontConfig config;
      config.MergeMode = true;
      config.FontNo = part.number;
      atlas.AddFontFromFileTTF(part.file.c_str(), pixels_, &config, part.ranges.data());
    }
  }
}

void Fonts::need(std::string_view text) {
  while (!text.empty()) {
    std::uint32_t letter = 0;
    const auto size = decode_code_point(text, letter);
    text.remove_prefix(std::max<std::size_t>(size, 1));
    if (size == 0 || letter <= 0xff || letter > 0xffff) continue;
    if (letters_.size() >= kMostAddedLetters && !letters_.contains(letter)) {
      if (!std::exchange(is_full_, true))
        log::warn("names have more than {} different letters: the rest are question marks",
                  kMostAddedLetters);
      continue;
    }
    has_new_ |= letters_.insert(letter).second;
  }
}

bool Fonts::update() {
  if (!std::exchange(has_new_, false)) return false;
  parts_.clear();
  for (const std::uint32_t letter : letters_) {
    const auto font = find_font(letter);
    if (!font) {
      const std::string package = package_with(letter);
      if (missing_packages_.insert(package).second)
        log::warn("no font of this computer has the letter U+{:04X}: install {}", letter, package);
      continue;
    }
    auto part = std::ranges::find_if(parts_, [&](const Part& known) {
      return known.file == font->path && known.number == font->number;
    });
    if (part == parts_.end())
      part = parts_.insert(parts_.end(), Part{font->path, font->number, {}});
    part->ranges.insert(part->ranges.end(), 2, static_cast<unsigned short>(letter));
  }
  for (Part& part : parts_) part.ranges.push_back(0);
  load();
  return true;
}

bool Fonts::has(std::uint32_t letter) const {
  const ImFontAtlas& atlas = *ImGui::GetIO().Fonts;
  return letter <= 0xffff && !atlas.Fonts.empty() &&
         atlas.Fonts.front()->FindGlyphNoFallback(static_cast<ImWchar>(letter)) != nullptr;
}

}  // namespace trocar::ui
