#pragma once

// The configuration of a hall, a machine on which sessions are started on request: a file of TOML.
// deploy/trocar-hall.toml.example has every key, explained.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace trocar::hall {

inline constexpr std::size_t kMostOffers = 64;
inline constexpr int kMostSessions = 64;

// Something that may be started, by its name.
struct Offer {
  std::string name;
  std::string lesson;           // a lesson's name or file; empty: the organ alone
  std::string organ;            // a built-in organ or a file; a lesson brings it
  std::optional<double> cores;  // what a session is expected to take; empty: as measured before
  unsigned workers = 1;
  bool bleeds = false;
};

// Both ends belong to it.
struct PortRange {
  std::uint16_t first = 0, last = 0;

  int count() const { return last - first + 1; }
};

struct HallConfig {
  std::string address = "127.0.0.1";  // of the hall itself
  std::uint16_t port = 7694;
  bool has_tls = false;
  bool is_open_without_tls = false;  // others than this machine may reach it
  // With TLS: the hall's own are made if these are empty.
  std::string certificate_file, certificate_key_file;
  std::string key_file;
  std::filesystem::path recordings_folder, state_folder;
  std::string sessions_address = "127.0.0.1";
  std::string host;  // how people reach the sessions; empty: by the address
  PortRange ports{7710, 7729}, figures_ports{7730, 7749};
  int most_sessions = 8;
  double cores = 1;  // that sessions may take together
  int restarts = 3;  // of one session
  double code_hours = 12;
  std::vector<Offer> offers;
  std::string log_format = "text";  // of its servers; the command line says it

  const Offer* find_offer(const std::string& name) const;  // null: there is none
  std::string list_offers() const;                         // "liver, find-the-lump"
};

// Lower-case letters, digits and hyphens, 1 to 32 of them, a letter or digit first. Such a name may
// be a folder's.
bool is_name(const std::string& text);

// `machine_cores`: for a file that does not say how many to use. Errors name file, line and key.
Result<HallConfig> read_hall_config(const std::filesystem::path& file, double machine_cores);
Result<HallConfig> read_hall_config_text(std::string_view text, const std::string& source,
                                         double machine_cores);

}  // namespace trocar::hall
