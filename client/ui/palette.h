#pragma once

// The colours of the window's words. They are of the palette of Okabe and Ito (2008), which people
// with any kind of colour blindness tell apart: the three differ in lightness, too. A colour never
// says anything alone; the words beside it do. Red, green, blue, 0 to 1.

#include <array>

namespace trocar::ui {

using PaletteColour = std::array<float, 3>;
inline constexpr PaletteColour kSkyBlue{0.337f, 0.706f, 0.914f};  // all is well
inline constexpr PaletteColour kYellow{0.941f, 0.894f, 0.259f};   // worth knowing
inline constexpr PaletteColour kOrange{0.902f, 0.624f, 0.0f};     // something to do
inline constexpr PaletteColour kPanelGround{0.035f, 0.050f, 0.066f};

}  // namespace trocar::ui
