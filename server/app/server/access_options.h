#pragma once

// Options of trocar-server that say who may join, and how.

#include <cstdint>
#include <string>

namespace trocar::app {

struct AccessOptions {
  bool is_insecure = false;                // without TLS and codes, on this machine only
  std::string state_folder;                // empty: the default one
  std::string certificate_file, key_file;  // empty: the state folder's own
  double code_hours = 12;
  std::int64_t code_uses = 0;  // 0: without limit
  bool keeps_codes = false;
  std::string revoke;                 // code or role; empty: host a session
  bool puts_out = false;              // with `revoke`: who came with it has to go
  std::string new_code;               // role; empty: host a session
  std::uint32_t return_seconds = 30;  // how long a place is kept after its connection broke
  std::string audit_file;             // empty: audit.jsonl in the state folder
};

}  // namespace trocar::app
