#pragma once

// Numbers that stand for types in a binary glTF 2.0 file (its section 3.6.2.2).

namespace trocar::formats {

constexpr int kUInt8 = 5121, kUInt16 = 5123, kUInt32 = 5125, kFloat = 5126;

}  // namespace trocar::formats
