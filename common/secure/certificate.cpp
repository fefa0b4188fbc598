#include "common/secure/certificate.h"

#include <openssl/bio.h>
#include <openssl/ec.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <memory>

#include "common/secure/digest.h"

namespace trocar::secure {
namespace {

constexpr std::string_view kSalt = "trocar-certificate-1";
constexpr std::uint64_t kScryptN = 1 << 14, kScryptR = 8, kScryptP = 1;
constexpr std::uint64_t kScryptMemory = 64 << 20;
// Clients know it by its code and look at no date; others may.
constexpr long kLifetimeDays = 20 * 365;

struct Free {
  void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
  void operator()(X509* certificate) const { X509_free(certificate); }
  void operator()(BIO* bio) const { BIO_free_all(bio); }
  void operator()(X509_EXTENSION* extension) const { X509_EXTENSION_free(extension); }
};
using Key = std::unique_ptr<EVP_PKEY, Free>;
using Certificate = std::unique_ptr<X509, Free>;
using Bio = std::unique_ptr<BIO, Free>;

std::string text_of(const Bio& bio) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(bio.get(), &data);
  return {data, static_cast<std::size_t>(size)};
}

bool describe(X509* certificate, EVP_PKEY* key) {
  std::array<std::uint8_t, 8> serial{};
  fill_random(serial);
  std::uint64_t number = 1;
  for (const auto byte : serial) number = number << 7 | (byte & 0x7fu);
  auto* name = X509_get_subject_name(certificate);
  const auto* common_name = reinterpret_cast<const unsigned char*>("trocar-server");
  const std::unique_ptr<X509_EXTENSION, Free> host(
      X509V3_EXT_conf_nid(nullptr, nullptr, NID_subject_alt_name, "DNS:localhost,IP:127.0.0.1"));
  return host && X509_set_version(certificate, X509_VERSION_3) == 1 &&
         ASN1_INTEGER_set_uint64(X509_get_serialNumber(certificate), number) == 1 &&
         X509_gmtime_adj(X509_getm_notBefore(certificate), -24 * 3600) != nullptr &&
         X509_gmtime_adj(X509_getm_notAfter(certificate), kLifetimeDays * 24 * 3600) != nullptr &&
         X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_ASC, common_name, -1, -1, 0) == 1 &&
         X509_set_issuer_name(certificate, name) == 1 &&
         X509_add_ext(certificate, host.get(), -1) == 1 && X509_set_pubkey(certificate, key) == 1 &&
         X509_sign(certificate, key, EVP_sha256()) > 0;
}

}  // namespace

Result<Identity> make_identity() {
  const Key key(EVP_EC_gen("P-256"));
  const Certificate certificate(X509_new());
  const Bio key_text(BIO_new(BIO_s_mem())), certificate_text(BIO_new(BIO_s_mem()));
  const bool is_made = key && certificate && key_text && certificate_text &&
                       describe(certificate.get(), key.get()) &&
                       PEM_write_bio_PrivateKey(key_text.get(), key.get(), nullptr, nullptr, 0,
                                                nullptr, nullptr) == 1 &&
                       PEM_write_bio_X509(certificate_text.get(), certificate.get()) == 1;
  if (!is_made)
    return Error{ErrorCode::ResourceMissing, "OpenSSL cannot make a certificate (" +
                                                 last_openssl_error() +
                                                 "): name one with --certificate and --key"};
  return Identity{text_of(certificate_text), text_of(key_text)};
}

Result<Bytes> certificate_der(const std::string& pem, const std::string& name) {
  const Bio text(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())));
  const Certificate certificate(PEM_read_bio_X509(text.get(), nullptr, nullptr, nullptr));
  if (!certificate)
    return Error{ErrorCode::BadFile,
                 name + ": holds no certificate (" + last_openssl_error() + "): it must be PEM"};
  const int size = i2d_X509(certificate.get(), nullptr);
  Bytes der(static_cast<std::size_t>(size));
  auto* to = der.data();
  i2d_X509(certificate.get(), &to);
  return der;
}

HalfCode code_of_certificate(BytesView der) {
  const auto digest = sha256(der);
  const auto salt = bytes_of(kSalt);
  HalfCode code{};
  const int made = EVP_PBE_scrypt(reinterpret_cast<const char*>(digest.data()), digest.size(),
                                  salt.data(), salt.size(), kScryptN, kScryptR, kScryptP,
                                  kScryptMemory, code.data(), code.size());
  TROCAR_ASSERT(made == 1);
  return code;
}

}  // namespace trocar::secure
