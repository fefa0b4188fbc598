#include "common/secure/kept_identity.h"

#include "common/base/log.h"
#include "common/secure/private_files.h"

namespace trocar::secure {

namespace fs = std::filesystem;

Result<Identity> read_or_make_identity(const fs::path& folder, const std::string& name) {
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

}  // namespace trocar::secure
