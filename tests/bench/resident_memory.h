#pragma once

#include <fstream>
#include <string>

namespace trocar::bench {

// Returns the memory that a process holds now, MB.
inline double resident_mb(const std::string& process = "self") {
  double pages = 0;
  std::ifstream("/proc/" + process + "/statm") >> pages >> pages;
  return pages * 4096e-6;
}

}  // namespace trocar::bench
