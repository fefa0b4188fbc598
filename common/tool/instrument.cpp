#include "common/tool/instrument.h"

#include <algorithm>

#include "common/base/assert.h"
#include "common/tool/toml_reader.h"

namespace trocar::tool {

extern const std::string_view kInstrumentsText;  // instruments.toml

namespace {

constexpr std::size_t kFileLimitBytes = 64u << 10;
constexpr std::size_t kNameLimit = 16, kTextLimit = 120;

bool is_name(std::string_view name) {
  return !name.empty() && name.size() <= kNameLimit && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-';
  });
}

void read_length(TableReader& reader, std::string_view key, float& value_m, double least_mm,
                 double most_mm) {
  if (const auto mm = reader.number(key, least_mm, most_mm))
    value_m = static_cast<float>(*mm * 1e-3);
}

Instrument read_instrument(TableReader& reader) {
  Instrument instrument;
  auto& shape = instrument.shape;
  shape.grip_n = shape.edge_m = 0;
  instrument.name = reader.string("name").value_or("");
  if (!is_name(instrument.name))
    reader.fail("name",
                "is not 1 to 16 small letters, digits and hyphens, write one such as probe");
  instrument.text = reader.string("text").value_or("");
  if (instrument.text.size() > kTextLimit)
    reader.fail("text", "is longer than " + std::to_string(kTextLimit) + " bytes, shorten it");
  const auto form = reader.choice<Form, kFormCount>("form", {{{"plain", Form::Plain},
                                                              {"probe", Form::Probe},
                                                              {"grasper", Form::Grasper},
                                                              {"scissors", Form::Scissors},
                                                              {"scalpel", Form::Scalpel},
                                                              {"hook", Form::Hook},
                                                              {"spatula", Form::Spatula},
                                                              {"endoscope", Form::Endoscope},
                                                              {"endoscope-30", Form::Endoscope30},
                                                              {"suction", Form::Suction},
                                                              {"clipper", Form::Clipper},
                                                              {"coagulator", Form::Coagulator}}});
  shape.form = form.value_or(Form::Plain);
  read_length(reader, "radius_mm", shape.radius_m, 0.5, 50);
  read_length(reader, "length_mm", shape.length_m, 10, 1000);
  read_length(reader, "reach_mm", shape.reach_m, 1, 50);
  read_length(reader, "edge_mm", shape.edge_m, 1, 200);
  if (const auto width = reader.number("width_mm", 0, 100))
    shape.half_width_m = static_cast<float>(*width * 0.5e-3);
  if (const auto friction = reader.number("friction", 0, 2))
    shape.friction = static_cast<float>(*friction);
  if (const auto grip = reader.number("grip_n", 0.1, 100)) shape.grip_n = static_cast<float>(*grip);
  const bool has_edge = shape.form == Form::Scissors || shape.form == Form::Scalpel;
  if (has_edge && shape.edge_m == 0) reader.fail("edge_mm", "is missing, say how long the edge is");
  reader.finish();
  return instrument;
}

}  // namespace

Verb Instrument::grip_verb() const {
  if (shape.grip_n > 0) return Verb::Grasp;
  return shape.edge_m > 0 ? Verb::Cut : Verb::Push;
}

Verb Instrument::button_verb() const {
  return shape.edge_m > 0 ? Verb::Cut : grip_verb();
}

Result<std::vector<Instrument>> read_instruments_text(std::string_view text,
                                                      std::string_view source) {
  Document document(source);
  const auto table = parse_toml(document, text, source, kFileLimitBytes, "table of instruments",
                                "common/tool/instruments.toml");
  if (!table) return document.error();
  TableReader root(document, *table, "");
  std::vector<Instrument> read;
  const auto entries = root.tables("instrument");
  if (entries.empty()) root.fail("instrument", "is missing, add an [[instrument]] with its keys");
  for (const auto* entry : entries) {
    TableReader reader(document, *entry, "instrument[" + std::to_string(read.size()) + "]");
    auto instrument = read_instrument(reader);
    if (find_instrument(read, instrument.name) != nullptr)
      reader.fail("name", "is that of another one above, choose a different one");
    if (read.size() == kMostInstruments)
      reader.fail("", "is one too many, there may be " + std::to_string(kMostInstruments));
    if (!document.ok()) return document.error();
    read.push_back(std::move(instrument));
  }
  root.finish();
  if (!document.ok()) return document.error();
  return read;
}

Result<std::vector<Instrument>> read_instruments(const std::filesystem::path& file) {
  const auto text = read_text_file(file, kFileLimitBytes, "table of instruments");
  if (!text) return text.error();
  return read_instruments_text(*text, file.string());
}

std::span<const Instrument> instruments() {
  static const auto table = [] {
    auto read = read_instruments_text(kInstrumentsText, "instruments.toml");
    TROCAR_ASSERT(read.ok());
    return *std::move(read);
  }();
  return table;
}

const Instrument* find_instrument(std::span<const Instrument> table, std::string_view name) {
  const auto found = std::ranges::find(table, name, &Instrument::name);
  return found == table.end() ? nullptr : &*found;
}

}  // namespace trocar::tool
