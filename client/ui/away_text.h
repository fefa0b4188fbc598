#pragma once

// This text says what a person is told while the connection is broken. Nothing is drawn here.

#include <string>

namespace trocar::ui {

// "The connection broke 4 s ago. Trying again; your seat is kept for 26 s."
std::string describe_absence(double away_seconds, double left_seconds);

}  // namespace trocar::ui
