#include "common/plot/gnuplot.h"

#include <algorithm>

#include "common/process/memory_file.h"
#include "common/process/process.h"

namespace trocar::plot {
namespace {

constexpr std::size_t kMostPicture = std::size_t{256} << 20, kMostComplaint = 64 * 1024;

// gnuplot shows the line of its script, marks the place, then says what is wrong: the last line.
std::string last_line(const std::string& text) {
  const auto end = text.find_last_not_of(" \n");
  if (end == std::string::npos) return "without a message";
  const auto before = text.rfind('\n', end);
  const auto begin = before == std::string::npos ? 0 : before + 1;
  return text.substr(begin, std::min<std::size_t>(end + 1 - begin, 300));
}

}  // namespace

Result<std::string> run_gnuplot(const std::string& program, const std::string& script) {
  const process::MemoryFile in(script), out, complaints;
  const std::string without_start_file = "-d";
  auto child = process::Child::start({.words = {program, without_start_file},
                                      .in = in.descriptor(),
                                      .out = out.descriptor(),
                                      .errors = complaints.descriptor()});
  if (!child)
    return Error{child.error().code,
                 "plot: " + child.error().message + ", install gnuplot-nox (deploy/setup does)"};
  if (child->wait().exit_code == 0) return out.text(kMostPicture);
  return Error{ErrorCode::ResourceMissing,
               "plot: " + program + " failed: " + last_line(complaints.text(kMostComplaint))};
}

}  // namespace trocar::plot
