#include "server/session/participants/look_alike.h"

#include <unicode/normalizer2.h>
#include <unicode/uchar.h>
#include <unicode/unistr.h>
#include <unicode/uspoof.h>

namespace trocar::participants {
namespace {

const USpoofChecker* checker() {
  static const USpoofChecker* const kChecker = [] {
    UErrorCode error = U_ZERO_ERROR;
    return uspoof_open(&error);
  }();
  return kChecker;
}

icu::UnicodeString without_unseen(const icu::UnicodeString& text) {
  icu::UnicodeString seen;
  for (std::int32_t at = 0; at < text.length(); at = text.moveIndex32(at, 1)) {
    const UChar32 c = text.char32At(at);
    const bool is_second_space = c == U' ' && seen.endsWith(u" ", 1);
    if (!is_second_space && u_hasBinaryProperty(c, UCHAR_DEFAULT_IGNORABLE_CODE_POINT) == 0)
      seen.append(c);
  }
  return seen;
}

// The name stays as it is if ICU has no data.
icu::UnicodeString skeleton_of(std::string_view name) {
  const auto text =
      icu::UnicodeString::fromUTF8({name.data(), static_cast<std::int32_t>(name.size())});
  UErrorCode error = U_ZERO_ERROR;
  const auto* nfkc = icu::Normalizer2::getNFKCInstance(error);
  if (U_FAILURE(error) || checker() == nullptr) return text;
  const auto seen = without_unseen(nfkc->normalize(text, error));
  icu::UnicodeString skeleton;
  uspoof_getSkeletonUnicodeString(checker(), 0, seen, skeleton, &error);
  return U_FAILURE(error) ? text : skeleton;
}

}  // namespace

bool look_alike(std::string_view a, std::string_view b) {
  return a == b || skeleton_of(a) == skeleton_of(b);
}

}  // namespace trocar::participants
