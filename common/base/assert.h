#pragma once

// Our own bugs: state what must hold; both operands are in the message when it does not.
// Outside data (sockets, files, devices, command lines) is never asserted: it gets a Result.

namespace trocar {
[[noreturn]] void assert_failed(const char* expression, const char* file, int line);
}  // namespace trocar

// Always on.
#define TROCAR_ASSERT(condition)                               \
  do {                                                         \
    if (!(condition)) [[unlikely]]                             \
      ::trocar::assert_failed(#condition, __FILE__, __LINE__); \
  } while (false)

// For inner loops: on unless built as Release.
#ifdef NDEBUG
#define TROCAR_ASSERT_HOT(condition) static_cast<void>(0)
#else
#define TROCAR_ASSERT_HOT(condition) TROCAR_ASSERT(condition)
#endif
