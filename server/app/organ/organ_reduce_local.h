#pragma once

#include "common/base/result.h"
#include "server/app/organ/organ_reduce.h"

namespace trocar::app {

// Runs the reduce command with --method local.
Status run_reduce_local(ReduceCommand command);

}  // namespace trocar::app
