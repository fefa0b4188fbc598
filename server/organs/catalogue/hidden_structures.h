#pragma once

// The structures of a lesson, in an organ.

#include "common/base/result.h"
#include "common/lesson/lesson.h"
#include "server/organs/organ/organ.h"

namespace trocar::catalogue {

// Each structure becomes a region of its own stiffness, neo-Hookean; mass and everything else stay.
// An error if the organ's elements are too large for one of them, or its law cannot have regions.
Status add_structures(const lesson::Lesson& lesson, organ::Organ& organ);

}  // namespace trocar::catalogue
