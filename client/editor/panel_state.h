#pragma once

// The editor's panel as plain values: choices of the person, and what the panel says. The window
// acts on them.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/organs/edit/box_rule.h"
#include "server/organs/edit/editor.h"

namespace trocar::editor {

enum class Mode : std::uint8_t { Look, Hold, Region, Press };

inline constexpr float kLeastBrush_mm = 1, kMostBrush_mm = 100;
inline constexpr float kMostPaintDepth_mm = 200;
inline constexpr float kLeastTip_mm = 2, kMostTip_mm = 30;
inline constexpr float kLeastPress_mm = 1, kMostPress_mm = 50;

struct PanelState {
  Mode mode = Mode::Look;
  float brush_mm = 12, paint_depth_mm = 15;
  // A region that is painted: its number, or none for one that begins with the next stroke.
  std::optional<std::size_t> region;
  std::array<char, 64> new_name{};
  std::array<char, 512> file{};
  std::array<float, 3> low_mm{}, high_mm{};  // the box
  bool is_on_surface = true;
  edit::Part part;         // of which a material is chosen
  std::size_t choice = 0;  // of the materials; the one after the last is neo-Hookean
  float young_modulus_kpa = 4;
  float tip_mm = 10, press_mm = 6;  // radius, and how far the hand goes in
  bool shows_held = true, shows_regions = true, wants_fine = true;
  std::string message;
  bool is_trouble = false;
  bool asks_to_replace = false, asks_to_close = false;
  bool closes_when_saved = false;

  // The box of the six numbers. A region is of what lies inside it, too.
  edit::BoxRule box() const {
    const auto metres = [](const std::array<float, 3>& mm) {
      return Vec3d{mm[0] * 1e-3, mm[1] * 1e-3, mm[2] * 1e-3};
    };
    return {metres(low_mm), metres(high_mm), is_on_surface && mode != Mode::Region};
  }
  // The brush touches the mesh, which is shown while it paints.
  bool shows_fine() const { return wants_fine && mode != Mode::Hold && mode != Mode::Region; }
  void say(std::string text, bool is_bad = false) {
    message = std::move(text);
    is_trouble = is_bad;
  }
};

// A press that goes on, or the last one.
struct PressFigures {
  float force_n = 0, depth_mm = 0, most_n = 0;
  float share = 1;              // of simulated time in real time
  std::vector<float> forces_n;  // one a published frame
};

// A button that was pressed sets one of these.
struct PanelActions {
  bool undo = false, redo = false, save = false, replace = false, close = false;
  bool hold_box = false, release_box = false, hold_none = false;
  bool paint_box = false, unpaint_box = false, remove_region = false, raise_region = false,
       rename_region = false;
  bool use_material = false;
};

// The panel shows these of the organ. They are made anew when it changes.
struct PanelFigures {
  std::string name, source;
  std::vector<std::pair<std::string, std::string>> rows;
  std::vector<std::string> part_materials;  // [0] the organ's own, then the regions'
  std::vector<std::size_t> part_elements;   // tets or springs, likewise
  const char* element = "tets";
  std::vector<std::string> remarks;
};
PanelFigures figures_of(const edit::Editor& editor);

}  // namespace trocar::editor
