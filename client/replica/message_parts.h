#pragma once

// Parts that several messages have, as plain types.

#include "common/math/vec3.h"
#include "common/tool/tool.h"
#include "proto/wire.pb.h"

namespace trocar::replica {

inline Vec3f to_vec3(const proto::Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

inline tool::Verb to_verb(proto::Verb verb) {
  switch (verb) {
    case proto::VERB_PUSH:
      return tool::Verb::Push;
    case proto::VERB_GRASP:
      return tool::Verb::Grasp;
    case proto::VERB_CUT:
      return tool::Verb::Cut;
    default:
      return tool::Verb::None;
  }
}

}  // namespace trocar::replica
