#pragma once

// These are the messages that a page may say to a session.

#include "common/base/bytes.h"
#include "common/wire/framing.h"

namespace trocar::proto {
class Envelope;
}

namespace trocar::page {

// Decodes what a page has sent. False: it is none of the messages of one who holds no tools.
bool read_page_message(BytesView envelope, proto::Envelope& message);

}  // namespace trocar::page
