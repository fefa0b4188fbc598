#include "server/organs/material/material_file.h"

#include "common/tool/toml_reader.h"

namespace trocar::material {
namespace {

constexpr std::size_t kLimitBytes = 1u << 20;
constexpr double kLongestTime_s = 1e9;

// Absent: empty. `most` numbers, each in its range.
std::vector<double> read_list(tool::TableReader& reader, std::string_view key, std::size_t most,
                              double low, double high) {
  auto values = reader.numbers(key).value_or(std::vector<double>{});
  if (values.size() > most)
    reader.fail(key, "has " + std::to_string(values.size()) + " numbers, allowed are " +
                         std::to_string(most));
  for (const double value : values)
    if (value < low || value > high)
      reader.fail(key, "has " + tool::shown(value) + ", allowed are " + tool::shown(low) + " to " +
                           tool::shown(high));
  values.resize(std::min(values.size(), most));
  return values;
}

void read_relaxation(tool::TableReader& reader, HyperelasticMaterial& m) {
  const auto weights = read_list(reader, "weights", kMaxPronyTerms, 0, 1);
  const auto times = read_list(reader, "relaxation_times_s", kMaxPronyTerms, 1e-9, kLongestTime_s);
  if (weights.size() != times.size())
    reader.fail("weights", "are " + std::to_string(weights.size()) + " for " +
                               std::to_string(times.size()) +
                               " relaxation_times_s, write one for each");
  for (std::size_t k = 0; k < std::min(weights.size(), times.size()); ++k)
    m.relaxation.push_back({weights[k], times[k]});
}

void read_hyperelastic(tool::TableReader& reader, HyperelasticMaterial& m) {
  m.name = reader.string("name").value_or("");
  if (m.name.empty()) reader.fail("name", "is missing, write what messages call it");
  m.split =
      reader
          .choice<VolumeSplit, 2>(
              "form", {{{"unsplit", VolumeSplit::Unsplit}, {"isochoric", VolumeSplit::Isochoric}}})
          .value_or(VolumeSplit::Unsplit);
  const auto coefficients =
      read_list(reader, "c_i0_pa", kMaxPolynomialOrder, -kLargestModulus_pa, kLargestModulus_pa);
  if (coefficients.empty()) reader.fail_missing("c_i0_pa", "write [C10, C20, ...]");
  std::ranges::copy(coefficients, m.coefficients_pa.begin());
  if (const auto exponent = reader.number("exponent", 0, 1e3)) {
    m.energy = StrainEnergy::Exponential;
    m.exponent = *exponent;
    if (coefficients.size() > 1)
      reader.fail("c_i0_pa", "has " + std::to_string(coefficients.size()) +
                                 " numbers, an exponential law has C10 alone");
  }
  const auto bulk = reader.number("bulk_modulus_pa", 0, kLargestModulus_pa);
  if (!bulk) reader.fail_missing("bulk_modulus_pa", "write 40 times C10 or what is known");
  m.bulk_modulus_pa = bulk.value_or(0);
  read_relaxation(reader, m);
  reader.finish();
}

}  // namespace

Result<HyperelasticMaterial> parse_material_text(std::string_view text, std::string_view source) {
  tool::Document document(source);
  const auto table = tool::parse_toml(document, text, source, kLimitBytes, "material",
                                      "docs/organs-and-materials.md");
  if (!table) return document.error();
  tool::TableReader root(document, *table, "");
  HyperelasticMaterial material;
  material.source = source;
  if (const auto* hyperelastic = root.table("hyperelastic")) {
    tool::TableReader reader(document, *hyperelastic, "hyperelastic");
    read_hyperelastic(reader, material);
    if (const auto valid = validate(material); document.ok() && !valid)
      reader.fail("", valid.error().message);
  }
  root.finish();
  if (!root.has("hyperelastic"))
    root.fail("hyperelastic", "is missing, write [hyperelastic] above the constants");
  if (!document.ok()) return document.error();
  return material;
}

Result<HyperelasticMaterial> read_material_file(const std::filesystem::path& path) {
  const auto text = tool::read_text_file(path, kLimitBytes, "material");
  if (!text) return text.error();
  return parse_material_text(*text, path.string());
}

Result<HyperelasticMaterial> measured_material(const std::string& name_or_file) {
  if (const auto* known = find_measured_material(name_or_file)) return *known;
  if (name_or_file.ends_with(".toml")) return read_material_file(name_or_file);
  return Error{ErrorCode::Usage, "--material: '" + name_or_file + "' is not known, write " +
                                     measured_material_names() + " or the name of a .toml file"};
}

}  // namespace trocar::material
