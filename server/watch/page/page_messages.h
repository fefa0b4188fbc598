#pragma once

// These are the messages that a page may say to a session, and those that it is told in the
// session's stead.

#include <string>

#include "common/base/bytes.h"
#include "common/wire/framing.h"

namespace trocar::proto {
class Envelope;
}

namespace trocar::page {

// Decodes what a page has sent. False: it is none of the messages of one who holds no tools.
bool read_page_message(BytesView envelope, proto::Envelope& message);

// `reason`: a proto::GoodbyeReason.
wire::SharedBytes encode_goodbye(int reason, const std::string& text);
wire::SharedBytes encode_bye(const std::string& reason);
wire::SharedBytes encode_pong(std::uint64_t client_time_us, std::uint64_t tick,
                              std::uint64_t server_time_us);

}  // namespace trocar::page
