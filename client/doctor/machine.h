#pragma once

// Finds what this machine brings along: graphics, devices, room on the disk. Thread: the caller's,
// whose OpenGL context changes.

#include "client/doctor/measurements.h"
#include "client/doctor/visitor.h"

namespace trocar::doctor {

// Draws the organ of a visit for `seconds`, as fast as it goes, into memory; without an organ the
// renderer alone is found.
Graphics measure_graphics(const Visited& visited, double seconds);
// Takes no device away from a program that uses it.
std::vector<Device> find_devices();
std::optional<double> free_bytes_in(const std::string& folder);

}  // namespace trocar::doctor
