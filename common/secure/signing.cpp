#include "common/secure/signing.h"

#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/pem.h>

#include <filesystem>

#include "common/base/assert.h"
#include "common/base/log.h"
#include "common/secure/private_files.h"

namespace trocar::secure {
namespace {

namespace fs = std::filesystem;

using SharedKey = std::shared_ptr<EVP_PKEY>;

// A key with a password is not read: nobody is there to be asked for it.
int no_password(char*, int, int, void*) {
  return -1;
}

using ReadPem = EVP_PKEY* (*)(BIO*, EVP_PKEY**, pem_password_cb*, void*);

Result<SharedKey> read_key(const std::string& file, ReadPem read, const std::string& is_none) {
  const auto text = read_small_file(file);
  if (!text) return text.error();
  const std::unique_ptr<BIO, decltype(&BIO_free_all)> bio(
      BIO_new_mem_buf(text->data(), static_cast<int>(text->size())), BIO_free_all);
  TROCAR_ASSERT(bio != nullptr);
  SharedKey key(read(bio.get(), nullptr, no_password, nullptr), EVP_PKEY_free);
  static_cast<void>(last_openssl_error());  // what is wrong with it is said below
  if (key && EVP_PKEY_get_id(key.get()) == EVP_PKEY_ED25519) return key;
  return Error{ErrorCode::BadFile, file + ": " + is_none};
}

PublicKey raw_key(const EVP_PKEY* key) {
  PublicKey raw{};
  std::size_t size = raw.size();
  const int got = EVP_PKEY_get_raw_public_key(key, raw.data(), &size);
  TROCAR_ASSERT(got == 1 && size == raw.size());
  return raw;
}

struct FreeContext {
  void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
};
using Context = std::unique_ptr<EVP_MD_CTX, FreeContext>;

}  // namespace

Result<SigningKey> SigningKey::read(const std::string& file) {
  auto key = read_key(file, PEM_read_bio_PrivateKey,
                      "is no private Ed25519 key in PEM form without a password: openssl genpkey "
                      "-algorithm ed25519 makes one");
  if (!key) return key.error();
  std::error_code ignored;
  if ((fs::status(file, ignored).permissions() & fs::perms::others_read) != fs::perms::none)
    log::warn("{}: others on this machine can read this key: chmod 600", file);
  return SigningKey(std::move(*key));
}

Signature SigningKey::sign(BytesView bytes) const {
  const Context context(EVP_MD_CTX_new());
  Signature signature{};
  std::size_t size = signature.size();
  const bool is_made =
      context && EVP_DigestSignInit(context.get(), nullptr, nullptr, nullptr, key_.get()) == 1 &&
      EVP_DigestSign(context.get(), signature.data(), &size, bytes.data(), bytes.size()) == 1;
  TROCAR_ASSERT(is_made && size == signature.size());
  return signature;
}

PublicKey SigningKey::public_key() const {
  return raw_key(key_.get());
}

Result<PublicKey> read_public_key(const std::string& file) {
  const auto key = read_key(file, PEM_read_bio_PUBKEY,
                            "is no public Ed25519 key in PEM form: openssl pkey -in KEY -pubout "
                            "makes that of a private one");
  if (!key) return key.error();
  return raw_key(key->get());
}

bool is_signed_by(const PublicKey& key, BytesView bytes, const Signature& signature) {
  const SharedKey known(
      EVP_PKEY_new_raw_public_key(EVP_PKEY_ED25519, nullptr, key.data(), key.size()),
      EVP_PKEY_free);
  const Context context(EVP_MD_CTX_new());
  const bool is_signed =
      known && context &&
      EVP_DigestVerifyInit(context.get(), nullptr, nullptr, nullptr, known.get()) == 1 &&
      EVP_DigestVerify(context.get(), signature.data(), signature.size(), bytes.data(),
                       bytes.size()) == 1;
  static_cast<void>(last_openssl_error());
  return is_signed;
}

RunningSha256::RunningSha256() : context_(EVP_MD_CTX_new(), EVP_MD_CTX_free) {
  const int begun = EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr);
  TROCAR_ASSERT(begun == 1);
}

void RunningSha256::update(BytesView bytes) {
  const int taken = EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size());
  TROCAR_ASSERT(taken == 1);
}

Digest RunningSha256::digest() const {
  const Context copy(EVP_MD_CTX_new());
  Digest digest{};
  const bool is_made = copy && EVP_MD_CTX_copy_ex(copy.get(), context_.get()) == 1 &&
                       EVP_DigestFinal_ex(copy.get(), digest.data(), nullptr) == 1;
  TROCAR_ASSERT(is_made);
  return digest;
}

}  // namespace trocar::secure
