#pragma once

#include <cstdint>

namespace trocar {

inline constexpr const char* kVersion = "0.1.0";

// Raised with every change of simulation results. Equal sim_version means equal tick hashes for the
// same inputs, on any x86-64-v3 machine, compiler and build type.
inline constexpr std::uint32_t kSimVersion = 29;

// Wire protocol. Major must match; a newer minor only adds fields and messages.
inline constexpr std::uint32_t kProtocolMajor = 1;
inline constexpr std::uint32_t kProtocolMinor = 24;

}  // namespace trocar
