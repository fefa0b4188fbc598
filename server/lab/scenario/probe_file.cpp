#include "server/lab/scenario/probe_file.h"

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace trocar::scenario {
namespace {

using scenario::ProbeQuantity;

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
    case ProbeQuantity::StartForce:
    case ProbeQuantity::EndForce:
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
                                    const scenario::Scenario& scenario) {
  ProbeFile result;
  result.path_ = path;
  result.file_.reset(std::fopen(path.c_str(), "wb"));
  if (!result.file_) return cannot_write(path);
  result.is_static_ = scenario.run.mode == scenario::RunMode::Static;
  for (const auto& probe : scenario.probes)
    result.per_si_.push_back(unit_of(probe.quantity).per_si);
  std::fputs("time_s", result.file_.get());
  for (const auto& probe : scenario.probes)
    for (const char axis : {'x', 'y', 'z'})
      std::fprintf(result.file_.get(), ",%s_%c_%s", probe.name.c_str(), axis,
                   unit_of(probe.quantity).suffix);
  std::fputc('\n', result.file_.get());
  return result;
}

void ProbeFile::add(const ScenarioRun& run) {
  std::vector<std::optional<Vec3d>> values(run.scenario().probes.size());
  for (std::size_t i = 0; i < values.size(); ++i)
    if (run.is_due(i)) values[i] = run.probe(i);
  if (is_static_) return add(run.time_s(), values);
  char time[40];
  std::snprintf(time, sizeof time, "%.3f", run.time_s());
  add_row(time, values);
}

void ProbeFile::add(double time_s, std::span<const std::optional<Vec3d>> values) {
  char time[40];
  std::snprintf(time, sizeof time, "%.9g", time_s);
  add_row(time, values);
}

void ProbeFile::add_row(const char* time, Values values) {
  const auto is_due = [](const auto& value) { return value.has_value(); };
  if (std::none_of(values.begin(), values.end(), is_due)) return;
  std::fputs(time, file_.get());
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!values[i]) {
      std::fputs(",,,", file_.get());
      continue;
    }
    const Vec3d value = *values[i] * per_si_[i];
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
