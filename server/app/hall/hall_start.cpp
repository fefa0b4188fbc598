#include "server/app/hall/hall_start.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <thread>

#include "common/base/log.h"
#include "common/base/own_folder.h"
#include "common/base/writable.h"
#include "common/secure/digest.h"
#include "common/secure/kept_identity.h"
#include "common/secure/private_files.h"
#include "server/bus/bus.h"
#include "server/hall/sessions/state_file.h"
#include "server/organs/catalogue/load_organ.h"

namespace trocar::app {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMadeKeyBytes = 32;
constexpr std::size_t kLeastKey = 32, kMostKey = 256;  // characters

fs::path server_program() {
  return own_folder() / "trocar-server";
}

// A key goes over HTTP in one word.
bool is_key(const std::string& text) {
  return text.size() >= kLeastKey && text.size() <= kMostKey &&
         std::ranges::all_of(text, [](char c) { return c > ' ' && c <= '~'; });
}

Result<std::string> read_or_make_hall_key(const fs::path& file) {
  std::error_code ignored;
  if (fs::exists(file, ignored)) return read_key(file);
  std::array<std::uint8_t, kMadeKeyBytes> random{};
  secure::fill_random(random);
  const auto key = secure::to_hex(random);
  if (file.has_parent_path()) fs::create_directories(file.parent_path(), ignored);
  if (const auto written = secure::write_private_file(file, key + "\n"); !written)
    return written.error();
  log::info("{}: the hall's key, made now", file.string());
  return key;
}

Result<hall::HallConfig> read_config(const HallOptions& options) {
  const double cores = std::max(1u, std::thread::hardware_concurrency());
  auto config = hall::read_hall_config(options.config_file, cores);
  if (!config || !config->state_folder.empty()) return config;
  const auto state = secure::default_state_folder();
  if (!state) return state.error();
  config->state_folder = *state / "hall";
  return config;
}

// Makes the hall's own certificate if it has to, in a folder that is nobody else's.
Result<secure::TlsContext> read_certificate(const hall::HallConfig& config) {
  const auto folder = config.state_folder / "tls";
  if (config.certificate_file.empty())
    for (const auto& made : {config.state_folder, folder})
      if (const auto is_made = secure::make_private_folder(made); !is_made) return is_made.error();
  const auto kept = secure::read_or_make_identity(config.certificate_file,
                                                  config.certificate_key_file, folder, "hall");
  if (!kept) return kept.error();
  const bool is_own = config.certificate_file.empty();
  const auto name =
      is_own ? kept->source : "certificate, certificate-key: " + config.certificate_file;
  log::info("TLS with the certificate {}", is_own ? kept->source : config.certificate_file);
  return secure::make_server_context(kept->identity, name);
}

// Says whether the sessions of an earlier hall and the audit log can be had.
Status check_state(const hall::HallConfig& config) {
  if (const auto state = hall::StateFile::check(config.state_folder); !state) return state;
  std::error_code ignored;
  if (fs::exists(config.state_folder, ignored))
    if (const auto log = check_writable(config.state_folder / "audit.jsonl"); !log) return log;
  return {};
}

Status check_certificate(const hall::HallConfig& config) {
  if (!config.has_tls) return {};
  std::error_code ignored;
  const auto own = config.state_folder / "tls";
  const bool is_own = config.certificate_file.empty();
  if (is_own)
    if (const auto folder = secure::check_private_folder(own); !folder) return folder;
  const bool is_made =
      fs::exists(own / "hall.crt", ignored) && fs::exists(own / "hall.key", ignored);
  if (is_own && !is_made) return {};
  const auto tls = read_certificate(config);
  return tls ? Status() : Status(tls.error());
}

Status check_program() {
  const auto program = server_program();
  if (::access(program.c_str(), X_OK) == 0) return {};
  return Error{ErrorCode::ResourceMissing,
               program.string() + ": is missing, it has to lie beside trocar-hall"};
}

}  // namespace

Result<std::string> read_key(const fs::path& file) {
  auto text = secure::read_private_file(file);
  if (!text) return text;
  while (text->ends_with('\n') || text->ends_with('\r')) text->pop_back();
  if (is_key(*text)) return text;
  return Error{ErrorCode::BadFile,
               file.string() +
                   ": holds no key of 32 to 256 printable characters without spaces: "
                   "remove it, and the hall makes another"};
}

Result<HallStart> prepare_hall(const HallOptions& options) {
  HallStart start;
  auto config = read_config(options);
  if (!config) return config.error();
  start.config = std::move(*config);
  start.config.log_format = options.log_format;
  if (const auto there = check_program(); !there) return there.error();
  start.server_program = server_program();
  auto key = read_or_make_hall_key(start.config.key_file);
  if (!key) return key.error();
  start.key = std::move(*key);
  if (!start.config.has_tls) return start;
  auto tls = read_certificate(start.config);
  if (!tls) return tls.error();
  start.tls = std::move(*tls);
  return start;
}

Status check_hall_start(const HallOptions& options) {
  const auto config = read_config(options);
  if (!config) return config.error();
  if (const auto there = check_program(); !there) return there;
  const auto of_key = [&options](const char* key, const Status& status) {
    return Error{status.error().code,
                 options.config_file + ": key " + key + ": " + status.error().message};
  };
  std::error_code ignored;
  if (fs::exists(config->key_file, ignored)) {
    if (const auto key = read_key(config->key_file); !key) return of_key("key", key.error());
  } else if (const auto folder =
                 check_writable_folder(fs::absolute(config->key_file, ignored).parent_path());
             !folder) {
    return of_key("key", folder);
  }
  if (const auto folder = check_writable_folder(config->recordings_folder); !folder)
    return of_key("recordings", folder);
  if (const auto state = check_state(*config); !state) return of_key("state", state);
  if (const auto certificate = check_certificate(*config); !certificate) return certificate;
  if (!options.nats.url.empty())
    if (const auto place = bus::Bus::check(options.nats); !place) return place;
  if (!options.ready_file.empty())
    if (const auto ready = check_writable(options.ready_file); !ready)
      return Error{ready.error().code, "--ready-file: " + ready.error().message};
  for (const auto& offer : config->offers)
    if (const auto organ = catalogue::load_organ(offer.organ); !organ)
      return Error{organ.error().code,
                   options.config_file + ": offer " + offer.name + ": " + organ.error().message};
  return {};
}

}  // namespace trocar::app
