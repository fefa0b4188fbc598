#pragma once

// Signatures by Ed25519, with keys in PEM files as `openssl genpkey -algorithm ed25519` makes them,
// and a SHA-256 of what comes piece by piece.

#include <array>
#include <memory>
#include <string>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/secure/digest.h"

struct evp_pkey_st;
struct evp_md_ctx_st;

namespace trocar::secure {

using Signature = std::array<std::uint8_t, 64>;
using PublicKey = std::array<std::uint8_t, 32>;

class SigningKey {
 public:
  // Reads a private key without a password. Who else may read the file is warned of, not refused.
  static Result<SigningKey> read(const std::string& file);

  Signature sign(BytesView bytes) const;
  PublicKey public_key() const;

 private:
  explicit SigningKey(std::shared_ptr<evp_pkey_st> key) : key_(std::move(key)) {}

  std::shared_ptr<evp_pkey_st> key_;
};

// Reads a file as `openssl pkey -pubout` makes it.
Result<PublicKey> read_public_key(const std::string& file);

bool is_signed_by(const PublicKey& key, BytesView bytes, const Signature& signature);

class RunningSha256 {
 public:
  RunningSha256();
  void update(BytesView bytes);
  Digest digest() const;  // of all so far; more may follow

 private:
  std::shared_ptr<evp_md_ctx_st> context_;
};

}  // namespace trocar::secure
