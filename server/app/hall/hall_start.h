#pragma once

// Before the first session a hall needs its configuration, its key and its folders.

#include <filesystem>
#include <string>

#include "common/base/result.h"
#include "common/secure/tls.h"
#include "server/app/hall/options.h"
#include "server/hall/plan/hall_config.h"

namespace trocar::app {

struct HallStart {
  hall::HallConfig config;
  std::string key;
  secure::TlsContext tls;  // null: without
  std::filesystem::path server_program;
};

// Reads what is there, and makes key, certificate and folder of state if they are missing.
Result<HallStart> prepare_hall(const HallOptions& options);
// Says whether a start would succeed as far as files, folders and organs go, without making
// anything. What only a start shows is left out: ports, other halls, NATS.
Status check_hall_start(const HallOptions& options);
// The key as a file has it, without the line's end. Others may not read that file.
Result<std::string> read_key(const std::filesystem::path& file);

}  // namespace trocar::app
