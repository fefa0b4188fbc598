#pragma once

// Judges measurements in words: for each of them whether it is good, what it means and what to do
// about it, and whether this machine can take part.
//
// 100 ms is the time within which a person feels that a picture answers the hand (Card
// 1991); above 300 ms surgeons work worse (Xu 2014).

#include <string>
#include <vector>

#include "client/doctor/measurements.h"
#include "common/base/json.h"

namespace trocar::doctor {

inline constexpr double kGoodAgeMs = 100, kWorstAgeMs = 300;
inline constexpr double kGoodLostShare = 0.02;   // beyond, more than one frame a second is late
inline constexpr double kGoodFramesShare = 0.9;  // of frames that the server makes
inline constexpr double kGoodPicturesPerSecond = 25;  // as films and television
inline constexpr double kGoodSessionSpeed = 0.95;
inline constexpr double kGoodFreeBytes = 1e9;

// The values are exit codes of the program.
enum class Grade : int { Good = 0, Limited = 1, Impossible = 2 };

struct Finding {
  std::string subject;  // "round trip"
  Grade grade = Grade::Good;
  std::string text;    // one sentence with the figures
  std::string advice;  // one sentence; empty where nothing is to be done
};

struct Advice {
  Grade grade = Grade::Good;  // the worst of all
  std::vector<Finding> findings;
  std::string verdict;  // "You can take part. ..."
};

Advice judge(const Measurements& measured);

std::string to_text(const Advice& advice);
Json to_json(const Advice& advice, const Measurements& measured);

}  // namespace trocar::doctor
