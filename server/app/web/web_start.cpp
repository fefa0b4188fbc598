#include "server/app/web/web_start.h"

#include <array>
#include <filesystem>
#include <utility>

#include "common/base/log.h"
#include "common/base/own_folder.h"
#include "common/base/printable.h"
#include "common/base/writable.h"
#include "common/intake/acceptor.h"
#include "common/secure/digest.h"
#include "common/secure/kept_identity.h"
#include "common/secure/private_files.h"

namespace trocar::app {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kKeyBytes = 16;
constexpr const char *kKeyFile = "web-recordings.key", *kPracticeKeyFile = "web-practice.key";

Result<fs::path> state_folder(const WebOptions& options) {
  if (!options.state_folder.empty()) return fs::absolute(options.state_folder);
  return secure::default_state_folder();
}

fs::path page_folder(const WebOptions& options) {
  if (!options.page_folder.empty()) return options.page_folder;
  std::error_code ignored;
  const auto root = own_folder().parent_path();
  const auto installed = root / "share/trocar/web";
  return fs::exists(installed, ignored) ? installed : root / "web/page";
}

bool needs_state(const WebOptions& options) {
  return !options.is_insecure || !options.recordings_folder.empty() ||
         !options.practice.offer.empty();
}

Result<secure::TlsContext> read_certificate(const WebOptions& options, const fs::path& state) {
  const auto kept =
      secure::read_or_make_identity(options.certificate_file, options.key_file, state, "web");
  if (!kept) return kept.error();
  return secure::make_server_context(kept->identity, kept->source);
}

Result<std::string> read_or_make_key(const fs::path& file, bool makes_new) {
  std::error_code ignored;
  if (!makes_new && fs::exists(file, ignored)) {
    auto text = secure::read_private_file(file);
    if (!text || text->size() == 2 * kKeyBytes) return text;
    return Error{ErrorCode::BadFile, file.string() + ": holds no key: remove it"};
  }
  std::array<std::uint8_t, kKeyBytes> random{};
  secure::fill_random(random);
  const auto key = secure::to_hex(random);
  if (const auto written = secure::write_private_file(file, key); !written) return written.error();
  return key;
}

// Says whether certificate and key can be read, or made in the folder of state.
Status check_state(const WebOptions& options) {
  const auto state = state_folder(options);
  if (!state) return state.error();
  if (needs_state(options))
    if (const auto folder = secure::check_private_folder(*state); !folder)
      return Error{folder.error().code, "--state: " + folder.error().message};
  std::error_code ignored;
  const bool is_made =
      fs::exists(*state / "web.crt", ignored) && fs::exists(*state / "web.key", ignored);
  if (!options.is_insecure && (is_made || !options.certificate_file.empty()))
    if (const auto tls = read_certificate(options, *state); !tls) return tls.error();
  if (options.recordings_folder.empty() || options.makes_new_key ||
      !fs::exists(*state / kKeyFile, ignored))
    return {};
  const auto key = read_or_make_key(*state / kKeyFile, false);
  return key ? Status() : Status(key.error());
}

}  // namespace

Result<WebStart> prepare_web(const WebOptions& options) {
  WebStart start;
  auto page = site::PageFiles::read(page_folder(options));
  if (!page) return Error{page.error().code, "--page: " + page.error().message};
  start.content.page = std::move(*page);
  const auto state = state_folder(options);
  if (!state) return state.error();
  if (needs_state(options))
    if (const auto made = secure::make_private_folder(*state); !made) return made.error();
  if (!options.is_insecure) {
    auto tls = read_certificate(options, *state);
    if (!tls) return tls.error();
    start.tls = std::move(*tls);
  }
  if (!options.practice.offer.empty()) {
    auto key = read_or_make_key(*state / kPracticeKeyFile, false);
    if (!key) return key.error();
    start.content.practice_key = std::move(*key);
  }
  if (options.recordings_folder.empty()) return start;
  auto recordings = site::Recordings::open(options.recordings_folder);
  if (!recordings) return recordings.error();
  auto key = read_or_make_key(*state / kKeyFile, options.makes_new_key);
  if (!key) return key.error();
  if (const auto names = recordings->left_out(); !names.empty())
    log::warn(
        "{}: {} recordings are not shown, {} among them: name them by letters, digits, ., _ "
        "and - alone",
        options.recordings_folder, names.size(), printable(names.front(), 80));
  start.content.recordings = std::move(*recordings);
  start.content.recordings_key = std::move(*key);
  start.content.state_folder = *state;
  return start;
}

Status check_web_start(const WebOptions& options) {
  const auto page = site::PageFiles::read(page_folder(options));
  if (!page) return Error{page.error().code, "--page: " + page.error().message};
  if (!options.recordings_folder.empty())
    if (const auto recordings = site::Recordings::open(options.recordings_folder); !recordings)
      return recordings.error();
  for (const auto& [option, address] :
       {std::pair{"--listen", &options.address}, {"--metrics", &options.metrics_address}})
    if (!address->empty())
      if (const auto fine = intake::check_address(*address, option); !fine) return fine;
  if (!options.ready_file.empty())
    if (const auto ready = check_writable(options.ready_file); !ready)
      return Error{ready.error().code, "--ready-file: " + ready.error().message};
  return check_state(options);
}

}  // namespace trocar::app
