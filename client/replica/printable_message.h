#pragma once

// A server is a stranger, and its text may reach a terminal: it is made printable first.

namespace trocar::proto {
class Envelope;
}

namespace trocar::replica {

// Puts a question mark for each character of a name, reason or other text that cannot be printed.
void make_printable(proto::Envelope& message);

}  // namespace trocar::replica
