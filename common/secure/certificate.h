#pragma once

// The server's certificate: made once, self-signed, ECDSA over P-256. Nobody vouches for it; a
// client knows it by the 40 bits in the join code, or trusts a CA that signed another one.
//
// The 40 bits are stretched: scrypt (N = 2^14, r = 8, p = 1, salt "trocar-certificate-1") of the
// SHA-256 of the certificate's DER. Who wants another certificate with the same bits needs 2^40
// scrypts of 16 MiB each, about 2^40 times 40 ms of one core.

#include <string>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/secure/join_code.h"

namespace trocar::secure {

struct Identity {
  std::string certificate_pem;  // perhaps with the chain behind it
  std::string key_pem;
};
Result<Identity> make_identity();

// Returns the DER of the first certificate in the text; `name` is the file's, for the error.
Result<Bytes> certificate_der(const std::string& pem, const std::string& name);
// Takes about 40 ms.
HalfCode code_of_certificate(BytesView der);

}  // namespace trocar::secure
