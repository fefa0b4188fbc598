#pragma once

// The panel at the left of the editor's window, by Dear ImGui. Thread: render thread, between
// Hud::begin_frame and Hud::render.

#include <span>

#include "client/editor/panel_state.h"

namespace trocar::editor {

// Its width beside the organ, in letters' heights.
inline constexpr float kPanelLetters = 24;

// Draws it `width` pixels wide and returns what the person wants. `materials`: those that can be
// chosen, with their sources.
PanelActions draw_panel(const edit::Editor& editor, const PanelFigures& figures,
                        const PressFigures& press,
                        std::span<const material::HyperelasticMaterial> materials, float width,
                        PanelState& state);

// Draws a ring of the brush, through these pixels.
void draw_ring(std::span<const std::array<float, 2>> pixels, bool takes_away);

}  // namespace trocar::editor
