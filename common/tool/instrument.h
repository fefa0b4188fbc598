#pragma once

// The instruments that a hand can hold: a shape, and from it what the hand's grip and button ask of
// the tissue. What each feels like follows from the shape: a wide tip is stiffer than a thin one,
// jaws hold, an edge parts what it meets. common/tool/instruments.toml is the table that programs
// bring, and says what the keys mean.

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/tool/tool.h"

namespace trocar::tool {

inline constexpr std::size_t kMostInstruments = 32;

struct Instrument {
  std::string name;
  std::string text;  // one line for people
  ToolShape shape;

  // A closed grip asks for this. Push: it only presses.
  Verb grip_verb() const;
  // A second button asks for this.
  Verb button_verb() const;
};

// The first one is what a hand holds if nothing is said.
std::span<const Instrument> instruments();
// A table of somebody's own: 1 to kMostInstruments, each with a name of its own. Errors are one
// line, with file, line and key.
Result<std::vector<Instrument>> read_instruments(const std::filesystem::path& file);
Result<std::vector<Instrument>> read_instruments_text(std::string_view text,
                                                      std::string_view source);
// Null: there is no such instrument.
const Instrument* find_instrument(std::span<const Instrument> table, std::string_view name);
inline const Instrument* find_instrument(std::string_view name) {
  return find_instrument(instruments(), name);
}

}  // namespace trocar::tool
