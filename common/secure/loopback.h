#pragma once

#include <string>

namespace trocar::secure {

// True for 127.0.0.1, others of 127.0.0.0/8, and ::1. A name is no address, whatever it looks like.
bool is_loopback(const std::string& address);

}  // namespace trocar::secure
