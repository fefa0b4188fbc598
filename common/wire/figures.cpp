#include "common/wire/figures.h"

namespace trocar::wire {

const char* name_of(RateLevel level) {
  switch (level) {
    case RateLevel::Fixed:
      return "fixed";
    case RateLevel::Full:
      return "full";
    case RateLevel::Reduced:
      return "reduced";
    case RateLevel::Overloaded:
      return "overloaded";
  }
  return "?";
}

const char* name_of(Stage stage) {
  switch (stage) {
    case Stage::Admit:
      return "admit";
    case Stage::Contacts:
      return "contacts";
    case Stage::Queue:
      return "queue";
    case Stage::Solve:
      return "solve";
    case Stage::Cut:
      return "cut";
    case Stage::Claims:
      return "claims";
    case Stage::Hash:
      return "hash";
    case Stage::Publish:
      return "publish";
    case Stage::Bleed:
      return "bleed";
  }
  return "?";
}

}  // namespace trocar::wire
