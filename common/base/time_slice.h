#pragma once

#include <sys/types.h>

namespace trocar {

// Asks the kernel to run this thread (0: the calling one) for 0.1 ms at a time, the least there is.
// It gets no more and no less of the processor. But when it wakes it soon has its turn, and when it
// runs beside one that wakes it soon makes way; the usual slice is one to three ticks long. Linux
// keeps it from version 6.12 on, and older kernels take no notice. Needs no privileges. Returns
// false where it is refused, which costs time and nothing else.
bool ask_for_short_slices(pid_t thread = 0);

}  // namespace trocar
