#include "server/organs/catalogue/load_organ.h"

#include "common/base/log.h"
#include "common/base/nearest_word.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/join_parts.h"
#include "server/organs/organ/organ_file.h"

namespace trocar::catalogue {

namespace {

constexpr BuiltIn kBuiltIn[] = {
    {"liver", "of tets, a measured material (human_liver_nava2008)",
     [] { return make_measured_liver(); }},
    {"elastic-liver", "of neo-Hookean tets; for slow machines", [] { return make_liver(); }},
    {"stomach", "hollow, its wall two tets thick or more", [] { return make_stomach(); }},
    {"lattice", "of springs: Choi's 30 x 15 x 30 nodes",
     [] { return Result<organ::Organ>(make_lattice()); }},
    {"plate", "Nakao's 16 x 16 x 0.4 cm", [] { return Result<organ::Organ>(make_plate()); }},
    {"chest", "wall and heart, the size of Nakao's",
     [] { return Result<organ::Organ>(make_chest()); }},
    {"pegs", "a board with three rings to move", [] { return Result<organ::Organ>(make_pegs()); }},
};

}  // namespace

std::span<const BuiltIn> built_in_organs() {
  return kBuiltIn;
}

std::string no_built_in(const std::string& name) {
  std::vector<std::string> names;
  std::string all;
  for (const auto& each : kBuiltIn) {
    names.emplace_back(each.name);
    all += (all.empty() ? "" : ", ") + names.back();
  }
  const auto meant = did_you_mean(name, names);
  return "'" + name + "' is no built-in organ" + (meant.empty() ? "." : meant) + " There are " +
         all +
         "; trocar-organ import FILE makes an organ of a mesh, a surface or a scan, and then you "
         "name its .organ file";
}

Result<organ::Organ> load_organ(const std::string& spec) {
  for (const auto& each : kBuiltIn)
    if (spec == each.name) return each.make();
  const std::filesystem::path path(spec);
  if (path.extension() == ".organ") return organ::read_organ(path);
  if (path.extension() == ".toml") {
    const auto file = read_part_file(path);
    if (!file) return file.error();
    auto joined = join_parts(*file);
    if (!joined) return joined.error();
    for (const std::string& note : joined->notes) log::info("{}: {}", spec, note);
    for (const std::string& warning : joined->warnings) log::warn("{}: {}", spec, warning);
    return std::move(joined->organ);
  }
  if (can_be_imported(path)) {
    auto imported = import_organ(path, {});
    if (!imported) return imported.error();
    for (const std::string& note : imported->notes) log::info("{}: {}", spec, note);
    for (const std::string& warning : imported->warnings) log::warn("{}: {}", spec, warning);
    return std::move(imported->organ);
  }
  return Error{ErrorCode::BadFile, "organ " + no_built_in(spec)};
}

}  // namespace trocar::catalogue
