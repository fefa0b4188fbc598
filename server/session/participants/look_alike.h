#pragma once

// Whether people could take one name for another: a Cyrillic letter for a Latin one, full width for
// half width, a zero for an O. By the skeletons of Unicode (UTS 39, as ICU has them), of the name's
// compatibility form (NFKC) without characters that are not seen. Case is seen, and counts.

#include <string_view>

namespace trocar::participants {

bool look_alike(std::string_view a, std::string_view b);

}  // namespace trocar::participants
