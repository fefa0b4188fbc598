#pragma once

#include "common/base/result.h"
#include "common/wire/hand_report.h"

namespace trocar::proto {
class HandLog;
class HandReport;
}  // namespace trocar::proto

namespace trocar::wire {

// Brings what is out of the message's ranges to their ends: a recording is not worth a session.
void write(const HandReport& report, proto::HandReport& message);
// A message is outside data: an error is one line that names the field.
Result<HandReport> read(const proto::HandReport& message);

// The same as it stands in a recording.
void write(const HandRecord& record, proto::HandLog& message);
Result<HandRecord> read(const proto::HandLog& message);

}  // namespace trocar::wire
