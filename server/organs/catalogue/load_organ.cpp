#include "server/organs/catalogue/load_organ.h"

#include "common/base/log.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/organ/organ_file.h"

namespace trocar::catalogue {

Result<organ::Organ> load_organ(const std::string& spec) {
  if (spec == "liver") return make_measured_liver();
  if (spec == "elastic-liver") return make_liver();
  if (spec == "lattice") return make_lattice();
  if (spec == "plate") return make_plate();
  if (spec == "stomach") return make_stomach();
  if (spec == "chest") return make_chest();
  if (spec == "pegs") return make_pegs();
  const std::filesystem::path path(spec);
  if (path.extension() == ".organ") return organ::read_organ(path);
  if (can_be_imported(path)) {
    auto imported = import_organ(path, {});
    if (!imported) return imported.error();
    for (const std::string& note : imported->notes) log::info("{}: {}", spec, note);
    for (const std::string& warning : imported->warnings) log::warn("{}: {}", spec, warning);
    return std::move(imported->organ);
  }
  return Error{
      ErrorCode::BadFile,
      "organ '" + spec +
          "' is neither liver, elastic-liver, lattice, plate, stomach, chest nor pegs, nor "
          "an .organ file or a mesh that can be imported"};
}

}  // namespace trocar::catalogue
