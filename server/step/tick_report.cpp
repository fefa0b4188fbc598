#include "server/step/tick_report.h"

namespace trocar::step {

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
    case Stage::Claims:
      return "claims";
    case Stage::Hash:
      return "hash";
    case Stage::Publish:
      return "publish";
  }
  return "?";
}

}  // namespace trocar::step
