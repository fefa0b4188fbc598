#include "server/organs/catalogue/part_file.h"

#include <algorithm>

#include "common/tool/toml_reader.h"

namespace trocar::catalogue {
namespace {

constexpr std::size_t kLimitBytes = 1u << 20;
constexpr double kLargest_mm = 2000;
constexpr int kMostCells = 200;

std::string entry(const char* table, std::size_t i) {
  return std::string(table) + "[" + std::to_string(i) + "]";
}

std::string needed(tool::TableReader& reader, const char* key, const char* advice) {
  auto text = reader.string(key);
  if (!text) reader.fail_missing(key, advice);
  if (text && text->size() > organ::kMostNameBytes)
    reader.fail(key, "is longer than 200 bytes, write less");
  return text.value_or("");
}

std::optional<Vec3d> read_size(tool::TableReader& reader) {
  const auto size_mm = reader.vector("size_mm");
  if (!size_mm) return std::nullopt;
  for (const double side : {size_mm->x, size_mm->y, size_mm->z})
    if (!(side >= 1 && side <= kLargest_mm))
      reader.fail("size_mm", "has " + tool::shown(side) + ", allowed are 1 to 2000");
  return *size_mm * 1e-3;
}

std::optional<std::array<int, 3>> read_cells(tool::TableReader& reader) {
  const auto cells = reader.integers("cells");
  if (!cells) return std::nullopt;
  const auto is_in = [](std::int64_t n) { return n >= 1 && n <= kMostCells; };
  if (cells->size() != 3 || !std::ranges::all_of(*cells, is_in)) {
    reader.fail("cells", "is not three numbers from 1 to 200, write [nx, ny, nz]");
    return std::nullopt;
  }
  return std::array{static_cast<int>((*cells)[0]), static_cast<int>((*cells)[1]),
                    static_cast<int>((*cells)[2])};
}

PartMaterial read_material(tool::TableReader& reader) {
  using material::ElasticLaw;
  PartMaterial material;
  material.measured = reader.string("measured");
  material.elastic_law =
      reader.choice<ElasticLaw, 3>("elastic_law", {{{"springs", ElasticLaw::Springs},
                                                    {"tensor-mass", ElasticLaw::TensorMass},
                                                    {"neo-hookean", ElasticLaw::NeoHookean}}});
  if (material.measured && material.elastic_law)
    reader.fail("elastic_law", "and measured exclude each other, remove one");
  material.has_averaged_strain = reader.boolean("averaged_strain");
  for (std::size_t i = 0; i < material.numbers.size(); ++i) {
    const auto& key = material::kNumberKeys[i];
    material.numbers[i] = reader.number(key.key, key.low, key.high);
  }
  return material;
}

void read_hold(tool::TableReader& reader, PartRule& part) {
  const auto hold = reader.string("hold");
  if (!hold) return;
  part.has_hold = true;
  part.is_held_whole = *hold == "all";
  if (part.is_held_whole) return;
  if (hold->starts_with("set:")) {
    part.import.fix_set = hold->substr(4);
    return;
  }
  const auto rule = organ::parse_fix_rule(*hold);
  if (!rule)
    reader.fail("hold",
                "is \"" + *hold +
                    "\", write \"none\", \"all\", \"set:NAME\", or \"bottom:0.2\", "
                    "\"top:0.2\" or \"back:0.2\" with the share of the height that is held");
  else
    part.import.fix = *rule;
}

// Keys that mean nothing with this source.
void check_source(tool::TableReader& reader, const PartRule& part) {
  const bool is_box = part.source == "box", is_shape = is_box || part.source == "ellipsoid";
  const bool is_file = !is_shape && can_be_imported(part.source);
  if (is_shape && !part.size_m) reader.fail_missing("size_mm", "write [x, y, z]");
  if (is_box && !part.cells) reader.fail_missing("cells", "write [nx, ny, nz]");
  const auto forbid = [&](const char* key, bool may, const char* of) {
    if (reader.has(key) && !may) reader.fail(key, std::string("is for ") + of + ", remove it");
  };
  forbid("size_mm", is_shape, "source = \"box\" or \"ellipsoid\"");
  forbid("cells", is_box, "source = \"box\"");
  forbid("nodes", is_file || (is_shape && !is_box), "surfaces, label maps and ellipsoids");
  forbid("unit", is_file, "meshes and surfaces of other programs");
  if (part.import.fix_set && !is_file)
    reader.fail("hold", "names a set, which only meshes of other programs have");
}

PartRule read_part(tool::TableReader& reader) {
  PartRule part;
  part.name = needed(reader, "name", "write what the part is called");
  part.source =
      needed(reader, "source", "write \"box\", \"ellipsoid\", a built-in organ or a file");
  part.at_m = reader.vector("at_mm").value_or(Vec3d{}) * 1e-3;
  if (!(length(part.at_m) <= 2)) reader.fail("at_mm", "is farther away than 2000 mm");
  part.size_m = read_size(reader);
  part.cells = read_cells(reader);
  if (const auto nodes = reader.integer("nodes", mesh::kMinFillNodes, mesh::kMaxFillNodes))
    part.import.nodes = static_cast<int>(*nodes);
  if (const auto unit = reader.choice<mesh::Unit, 3>("unit", {{{"m", mesh::Unit::Metre},
                                                               {"cm", mesh::Unit::Centimetre},
                                                               {"mm", mesh::Unit::Millimetre}}})) {
    part.import.unit = *unit;
    part.import.unit_is_said = true;
  }
  part.import.fix.side = organ::FixRule::Side::None;
  read_hold(reader, part);
  part.material = read_material(reader);
  part.look = reader.string("look").value_or("");
  if (part.look.size() > organ::kMostNameBytes)
    reader.fail("look", "is longer than 200 bytes, write less");
  check_source(reader, part);
  reader.finish();
  return part;
}

TieRule read_ties(tool::TableReader& reader, const PartFile& file) {
  TieRule ties;
  const auto between = reader.strings("between").value_or(std::vector<std::string>{});
  if (between.size() != 2)
    reader.fail("between", "is not two parts, write [\"gallbladder\", \"liver\"]");
  for (std::size_t i = 0; i < std::min<std::size_t>(between.size(), 2); ++i) {
    ties.between[i] = between[i];
    if (std::ranges::find(file.parts, between[i], &PartRule::name) == file.parts.end())
      reader.fail("between", "names \"" + between[i] + "\", which is no [[part]]");
  }
  if (between.size() == 2 && between[0] == between[1])
    reader.fail("between", "names one part twice, write two");
  ties.name = reader.string("name").value_or(ties.between[0] + "-" + ties.between[1]);
  for (const auto& other : file.ties)
    if (other.name == ties.name)
      reader.fail(reader.has("name") ? "name" : "between",
                  "makes a second [[ties]] named \"" + ties.name + "\", write another name");
  const auto within_mm = reader.number("within_mm", 0.01, 100);
  if (!within_mm) reader.fail_missing("within_mm", "write how long a tie may be");
  const auto each_mm2 = reader.number("each_mm2", 0.1, 1000);
  if (!each_mm2)
    reader.fail_missing("each_mm2", "write how much of the surface a tie stands for at most");
  ties.within_m = within_mm.value_or(1) * 1e-3;
  ties.area_m2 = each_mm2.value_or(1) * 1e-6;
  const organ::TieLaw usual;
  ties.law.strength_pa = reader.number("strength_pa", 1, 1e7).value_or(usual.strength_pa);
  ties.law.toughness_j_m2 =
      reader.number("toughness_j_m2", 1e-3, 1e5).value_or(usual.toughness_j_m2);
  ties.law.rise_m = reader.number("rise_mm", 1e-3, 100).value_or(usual.rise_m * 1e3) * 1e-3;
  if (const auto status = validate(ties.law); !status)
    reader.fail(reader.has("rise_mm") ? "rise_mm" : "strength_pa", status.error().message);
  reader.finish();
  return ties;
}

}  // namespace

bool is_part_file(const std::filesystem::path& path) {
  if (path.extension() != ".toml") return false;
  const auto text = tool::read_text_file(path, kLimitBytes, "part file");
  return text && (text->starts_with("[[part]]") || text->find("\n[[part]]") != std::string::npos);
}

Result<PartFile> read_part_file(const std::filesystem::path& path) {
  const auto text = tool::read_text_file(path, kLimitBytes, "part file");
  if (!text) return text.error();
  return parse_parts_text(*text, path.string());
}

Result<PartFile> parse_parts_text(std::string_view text, std::string_view source) {
  tool::Document document(source);
  const auto table =
      tool::parse_toml(document, text, source, kLimitBytes, "part file", "deploy/scenes/bed.toml");
  if (!table) return document.error();
  PartFile file;
  file.source = std::filesystem::path(source);
  tool::TableReader root(document, *table, "");
  const auto parts = root.tables("part");
  if (!root.has("part"))
    return Error{ErrorCode::BadFile, std::string(source) +
                                         ": key part: is missing, write [[part]] with its name and "
                                         "source; a scenario is for trocar-sim"};
  if (parts.size() > kMostParts)
    root.fail("part", "appears " + std::to_string(parts.size()) + " times, allowed are 100");
  for (std::size_t i = 0; i < parts.size() && document.ok(); ++i) {
    tool::TableReader reader(document, *parts[i], entry("part", i));
    auto part = read_part(reader);
    if (std::ranges::find(file.parts, part.name, &PartRule::name) != file.parts.end())
      reader.fail("name", "\"" + part.name + "\" is another part already, write another name");
    file.parts.push_back(std::move(part));
  }
  const auto ties = root.tables("ties");
  if (ties.size() > organ::kMaxTieBands)
    root.fail("ties", "appears " + std::to_string(ties.size()) + " times, allowed are 100");
  for (std::size_t i = 0; i < ties.size() && document.ok(); ++i) {
    tool::TableReader reader(document, *ties[i], entry("ties", i));
    file.ties.push_back(read_ties(reader, file));
  }
  root.finish();
  if (!document.ok()) return document.error();
  return file;
}

}  // namespace trocar::catalogue
