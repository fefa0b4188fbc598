#include "common/secure/kept_identity.h"

#include "common/base/log.h"
#include "common/secure/private_files.h"

namespace trocar::secure {

namespace fs = std::filesystem;

namespace {

Result<Identity> read_or_make_own(const fs::path& folder, const std::string& name) {
  const auto certificate_file = folder / (name + ".crt"), key_file = folder / (name + ".key");
  const FolderLock lock(folder);
  std::error_code ignored;
  if (!fs::exists(certificate_file, ignored) || !fs::exists(key_file, ignored)) {
    auto made = make_identity();
    if (!made) return made.error();
    Status written = write_private_file(key_file, made->key_pem);
    if (written) written = write_private_file(certificate_file, made->certificate_pem);
    if (!written) return written.error();
    log::info("made a certificate: {}", certificate_file.string());
    return made;
  }
  auto certificate = read_private_file(certificate_file);
  if (!certificate) return certificate.error();
  auto key = read_private_file(key_file);
  if (!key) return key.error();
  return Identity{std::move(*certificate), std::move(*key)};
}

}  // namespace

Result<KeptIdentity> read_or_make_identity(const std::string& certificate_file,
                                           const std::string& key_file, const fs::path& folder,
                                           const std::string& name) {
  if (certificate_file.empty()) {
    auto own = read_or_make_own(folder, name);
    if (!own) return own.error();
    return KeptIdentity{std::move(*own), (folder / (name + ".crt")).string()};
  }
  std::error_code ignored;
  auto certificate = read_small_file(certificate_file);
  if (!certificate) return certificate.error();
  auto key = read_small_file(key_file);
  if (!key) return key.error();
  if ((fs::status(key_file, ignored).permissions() & fs::perms::others_read) != fs::perms::none)
    log::warn("{}: others on this machine can read this key: chmod 600", key_file);
  return KeptIdentity{{std::move(*certificate), std::move(*key)},
                      "--certificate, --key: " + certificate_file};
}

}  // namespace trocar::secure
