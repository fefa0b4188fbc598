#pragma once

// These are the messages that a page may say to a session.

#include "common/base/bytes.h"
#include "common/wire/framing.h"
#include "common/wire/role.h"

namespace trocar::proto {
class Envelope;
}

namespace trocar::page {

// Decodes what a page has sent. False: it is none of the messages of that role.
bool read_page_message(BytesView envelope, wire::Role role, proto::Envelope& message);

}  // namespace trocar::page
