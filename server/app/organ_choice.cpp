#include "server/app/organ_choice.h"

#include "common/scene/builtin_organs.h"

namespace trocar::app {

Result<scene::Organ> load_organ(const std::string& name_or_file) {
  if (name_or_file == "lattice") return scene::make_lattice();
  return Error{ErrorCode::BadFile,
               "--organ: '" + name_or_file + "' is neither a built-in organ (lattice) nor a file"};
}

}  // namespace trocar::app
