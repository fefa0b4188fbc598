#include "server/python/tissue_arrays.h"

#include <algorithm>

#include "server/python/arrays.h"

namespace trocar::python {
namespace {

namespace py = pybind11;

// Calls visit(number) for each triangle that is there, ascending.
template <typename Visit>
void for_each_triangle(const wire::SurfaceLayout& layout, Visit&& visit) {
  for (std::size_t i = 0; i < layout.triangles.size(); ++i)
    if (layout.has_triangle(TriangleIndex(i))) visit(i);
}

}  // namespace

py::array triangles_of(const step::Simulation& simulation) {
  const auto& layout = simulation.layout();
  std::vector<std::uint32_t> numbers;
  numbers.reserve(3 * layout.triangles.size());
  for_each_triangle(layout, [&](std::size_t i) {
    for (const auto vertex : layout.triangles[i])
      numbers.push_back(layout.node_of_vertex[vertex.value].value);
  });
  return take_array(std::move(numbers), 3);
}

py::array wounds_of(const step::Simulation& simulation) {
  const auto& layout = simulation.layout();
  std::vector<std::uint8_t> flags;
  for_each_triangle(layout, [&](std::size_t i) { flags.push_back(layout.is_wound[i]); });
  return take_array(std::move(flags), 0).attr("view")("bool");
}

py::array tets_of(const step::Simulation& simulation) {
  const auto& topology = simulation.state().cuts.topology();
  std::vector<std::uint32_t> numbers;
  numbers.reserve(4 * topology.tet_count());
  for (std::size_t t = 0; t < topology.tet_count(); ++t)
    if (topology.has_tet(TetIndex(t)))
      for (const auto node : topology.tet(TetIndex(t))) numbers.push_back(node.value);
  return take_array(std::move(numbers), 4);
}

py::array rest_of(const step::Simulation& simulation) {
  std::vector<double> numbers;
  for (const auto& place : simulation.state().cuts.topology().rest())
    numbers.insert(numbers.end(), {place.x, place.y, place.z});
  return take_array(std::move(numbers), 3);
}

py::dict counts_of(const step::Simulation& simulation) {
  const auto& topology = simulation.state().cuts.topology();
  const auto& layout = simulation.layout();
  std::size_t nodes = 0, tets = 0, triangles = 0, wounds = 0;
  for (std::size_t n = 0; n < topology.node_count(); ++n) nodes += topology.has_node(NodeIndex(n));
  for (std::size_t t = 0; t < topology.tet_count(); ++t) tets += topology.has_tet(TetIndex(t));
  for_each_triangle(layout, [&](std::size_t i) {
    ++triangles;
    wounds += layout.is_wound[i] != 0;
  });
  py::dict out;
  out["nodes"] = nodes;
  out["tets"] = tets;
  out["triangles"] = triangles;
  out["wound_triangles"] = wounds;
  out["pieces"] = simulation.context().pieces.list().size();
  out["ties"] = topology.ties().whole_count();
  out["edits"] = simulation.state().cuts.history().size();
  return out;
}

}  // namespace trocar::python
