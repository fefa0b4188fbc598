#pragma once

// Names a NATS, and how one gets in.

#include <string>

#include "common/base/result.h"

namespace trocar::bus {

struct BusPlace {
  std::string url;      // nats://HOST:PORT or tls://HOST:PORT, or several with commas, no user
  std::string ca_file;  // PEM of who vouches for its certificate; empty: whom this machine trusts
  std::string creds_file;  // USER:PASSWORD, or NATS's own credentials (JWT); empty: none

  bool wants_tls() const { return url.starts_with("tls://"); }
};

// ErrorCode::Usage for a URL that is none or names a user, for addresses with TLS beside others
// without, and for a `ca_file` without TLS. What may hold a password is never part of the error.
Status check_place(const BusPlace& place);

}  // namespace trocar::bus
