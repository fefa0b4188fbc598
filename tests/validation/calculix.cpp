#include "tests/validation/calculix.h"

#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "common/base/text_file.h"
#include "common/process/process.h"

namespace trocar::validation {
namespace {

constexpr const char* kSolverProgram = "ccx";
// Orders above the first have no volumetric term of their own.
constexpr double kNoVolume = 1e20;

std::string mesh_of(const finite_elements::ElementMesh& mesh) {
  std::string text = "*NODE, NSET=ALL\n";
  for (std::size_t i = 0; i < mesh.node_count(); ++i) {
    const Vec3d& p = mesh.rest_positions[i];
    text += fmt::format("{}, {:.12g}, {:.12g}, {:.12g}\n", i + 1, p.x, p.y, p.z);
  }
  const bool is_linear = mesh.order == finite_elements::ElementOrder::Linear;
  text += fmt::format("*ELEMENT, TYPE={}, ELSET=BODY\n", is_linear ? "C3D4" : "C3D10");
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    text += std::to_string(e + 1);
    for (const auto node : mesh.nodes_of(e)) text += ", " + std::to_string(node + 1);
    text += "\n";
  }
  return text;
}

// Reads U of *NODE PRINT: the lines "number ux uy uz" below the last heading.
Result<Field> read_displacements(const std::filesystem::path& path, std::size_t node_count) {
  std::ifstream file(path);
  Field field(node_count);
  std::size_t found = 0;
  for (std::string line; std::getline(file, line);) {
    if (line.find("displacements") != std::string::npos) found = 0;
    std::istringstream numbers(line);
    std::size_t node = 0;
    Vec3d u;
    if (!(numbers >> node >> u.x >> u.y >> u.z) || node < 1 || node > node_count) continue;
    field[node - 1] = u;
    ++found;
  }
  if (found == node_count) return field;
  return Error{ErrorCode::BadFile, path.string() + ": has no displacements of all nodes"};
}

}  // namespace

bool has_calculix() {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path != nullptr ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');)
    if (access((folder + "/" + kSolverProgram).c_str(), X_OK) == 0) return true;
  return false;
}

Result<std::string> calculix_input(const finite_elements::Problem& problem,
                                   const finite_elements::Loads& loads) {
  const auto& m = problem.materials.front();
  if (problem.materials.size() != 1 || m.split != material::VolumeSplit::Isochoric ||
      m.energy != material::StrainEnergy::ReducedPolynomial || m.coefficients_pa[3] != 0 ||
      m.coefficients_pa[4] != 0)
    return Error{ErrorCode::Usage, "CalculiX has reduced polynomials up to N = 3, isochoric"};
  std::string text = mesh_of(problem.mesh);
  text += fmt::format(
      "*MATERIAL, NAME=TISSUE\n*HYPERELASTIC, REDUCED POLYNOMIAL, N=3\n"
      "{:.12g}, {:.12g}, {:.12g}, {:.12g}, {:.12g}, {:.12g}\n"
      "*SOLID SECTION, ELSET=BODY, MATERIAL=TISSUE\n",
      m.coefficients_pa[0], m.coefficients_pa[1], m.coefficients_pa[2], 2 / m.bulk_modulus_pa,
      kNoVolume, kNoVolume);
  // Residual and correction far below the usual 0.5 %: the comparison is of the models.
  text +=
      "*STEP, NLGEOM, INC=1000\n*CONTROLS, PARAMETERS=FIELD\n1e-7, 1e-7\n*STATIC\n"
      "0.2, 1., 1e-6, 0.2\n*BOUNDARY\n";
  for (std::size_t i = 0; i < problem.held_dofs.size(); ++i) {
    const auto dof = problem.held_dofs[i];
    text += fmt::format("{0}, {1}, {1}, {2:.12g}\n", dof / 3 + 1, dof % 3 + 1, loads.held_moves[i]);
  }
  if (loads.forces.norm() > 0) text += "*CLOAD\n";
  for (Eigen::Index i = 0; i < loads.forces.size(); ++i)
    if (loads.forces[i] != 0)
      text += fmt::format("{}, {}, {:.12g}\n", i / 3 + 1, i % 3 + 1, loads.forces[i]);
  return text + "*NODE PRINT, NSET=ALL, FREQUENCY=1000\nU\n*END STEP\n";
}

Result<Field> run_calculix(const std::filesystem::path& folder, const std::string& name,
                           const std::string& input, std::size_t node_count) {
  if (auto s = write_text_file(folder / (name + ".inp"), input); !s) return s.error();
  auto solver = process::Child::start(
      {.words = {"env", "-C", folder, kSolverProgram, "-i", name}, .log = folder / "ccx.log"});
  if (!solver || solver->wait().exit_code != 0)
    return Error{ErrorCode::BadFile,
                 (folder / "ccx.log").string() + ": CalculiX did not come to an end"};
  return read_displacements(folder / (name + ".dat"), node_count);
}

}  // namespace trocar::validation
