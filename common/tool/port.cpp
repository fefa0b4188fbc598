#include "common/tool/port.h"

#include <charconv>
#include <cmath>

#include "common/base/printable.h"

namespace trocar::tool {

Result<Vec3d> parse_port(const std::string& text) {
  double mm[3]{};
  const char* at = text.data();
  const char* const end = at + text.size();
  bool is_place = true;
  for (int i = 0; i < 3 && is_place; ++i) {
    const auto [stop, failure] = std::from_chars(at, end, mm[i]);
    is_place = failure == std::errc{} && std::abs(mm[i]) <= 2000 &&
               (i == 2 ? stop == end : stop < end && *stop == ',');
    at = stop + (i == 2 ? 0 : 1);
  }
  if (is_place) return Vec3d{mm[0], mm[1], mm[2]} * 1e-3;
  return Error{ErrorCode::Usage, "--port: '" + printable(text, 40) +
                                     "' is not X,Y,Z in mm, up to 2000 each, such as 0,120,150"};
}

}  // namespace trocar::tool
