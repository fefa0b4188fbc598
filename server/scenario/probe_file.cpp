#include "server/scenario/probe_file.h"

#include <cerrno>
#include <cstring>

namespace trocar::scenario {
namespace {

using scene::ProbeQuantity;

struct Unit {
  const char* suffix;
  double per_si;
};

Unit unit_of(ProbeQuantity quantity) {
  switch (quantity) {
    case ProbeQuantity::Displacement:
      return {"mm", 1e3};
    case ProbeQuantity::Velocity:
      return {"mm_s", 1e3};
    case ProbeQuantity::Reaction:
    case ProbeQuantity::ToolForce:
      return {"n", 1};
  }
  return {"", 1};
}

Error cannot_write(const std::filesystem::path& path) {
  return {ErrorCode::ResourceMissing,
          path.string() + ": cannot be written (" + std::strerror(errno) + "), check the folder"};
}

}  // namespace

Result<ProbeFile> ProbeFile::create(const std::filesystem::path& path,
                                    const scene::Scenario& scenario) {
  ProbeFile result;
  result.path_ = path;
  result.file_.reset(std::fopen(path.c_str(), "wb"));
  if (!result.file_) return cannot_write(path);
  std::fputs("time_s", result.file_.get());
  for (const auto& probe : scenario.probes)
    for (const char axis : {'x', 'y', 'z'})
      std::fprintf(result.file_.get(), ",%s_%c_%s", probe.name.c_str(), axis,
                   unit_of(probe.quantity).suffix);
  std::fputc('\n', result.file_.get());
  return result;
}

void ProbeFile::add(const ScenarioRun& run) {
  const auto& probes = run.scenario().probes;
  bool is_any_due = false;
  for (std::size_t i = 0; i < probes.size(); ++i) is_any_due |= run.is_due(i);
  if (!is_any_due) return;
  std::fprintf(file_.get(), run.scenario().run.mode == scene::RunMode::Static ? "%.9g" : "%.3f",
               run.time_s());
  for (std::size_t i = 0; i < probes.size(); ++i) {
    if (!run.is_due(i)) {
      std::fputs(",,,", file_.get());
      continue;
    }
    const Vec3d value = run.probe(i) * unit_of(probes[i].quantity).per_si;
    std::fprintf(file_.get(), ",%.9g,%.9g,%.9g", value.x, value.y, value.z);
  }
  std::fputc('\n', file_.get());
}

Status ProbeFile::close() {
  const bool is_good = std::ferror(file_.get()) == 0;
  if (std::fclose(file_.release()) != 0 || !is_good) return cannot_write(path_);
  return {};
}

}  // namespace trocar::scenario
