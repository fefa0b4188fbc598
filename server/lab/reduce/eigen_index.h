#pragma once

#include <Eigen/Core>
#include <cstddef>

namespace trocar::reduce {

// Eigen counts with a sign.
inline Eigen::Index index(std::size_t i) {
  return static_cast<Eigen::Index>(i);
}

}  // namespace trocar::reduce
