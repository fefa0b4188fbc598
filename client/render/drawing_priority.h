#pragma once

// Drawing in software takes a processor's time, which a server on the same machine needs for the
// tissue. So it yields: tissue, network and hands go first, and pictures get what is left.

namespace trocar::render {

// Lowers the priority of the calling thread, which is the one that draws, and of the threads with
// which Mesa draws, and shortens their time slices. There is no way back without privileges.
// Threads that are started later by the calling one inherit it, so it is called when network and
// hands run. Returns how many threads have it now.
int yield_to_other_work();

}  // namespace trocar::render
