#pragma once

// Says how many processors of this machine stand idle, from /proc/stat.

#include <cstdint>

namespace trocar::app {

class IdleProcessors {
 public:
  IdleProcessors();
  ~IdleProcessors();
  IdleProcessors(const IdleProcessors&) = delete;
  IdleProcessors& operator=(const IdleProcessors&) = delete;

  // Returns how many stood idle, in the mean since the last call; 0 at the first one, and where
  // nobody knows. Allocates nothing.
  double read();

 private:
  const int file_;
  double idle_s_ = 0, read_s_ = 0;  // as they were at the last call; 0: there was none
};

}  // namespace trocar::app
