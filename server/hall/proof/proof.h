#pragma once

// A request to a hall over the bus, with a proof that who asks has the hall's key: an HMAC-SHA256
// of the hall's name, its number of this start, request, time and a number used once. The key
// itself never crosses the bus, and a request that was overheard is good for nobody else, at no
// other hall, and not at one that was started since, which has another number in its directory.
//
//   {"method": "POST", "path": "/sessions", "body": "...", "time": 1700000000, "once": "<32 hex>",
//    "proof": "<64 hex>"}; without a key: no time, once and proof

#include <cstdint>
#include <map>
#include <string>

#include "common/base/result.h"

namespace trocar::hall {

enum class Proof : std::uint8_t { None, Wrong, Right };

struct BusRequest {
  std::string method, path, body;
  std::int64_t unix_s = 0;
  std::string once, proof;  // hexadecimal; empty: none
};

// Writes the text of a request to the hall of that name and start; without a proof where `key` is
// empty.
std::string write_bus_request(const std::string& hall, const std::string& start,
                              const std::string& method, const std::string& path,
                              const std::string& body, const std::string& key, std::int64_t unix_s);
// Reads the text of a request; ErrorCode::BadMessage if it is none.
Result<BusRequest> read_bus_request(const std::string& text);

// Knows which numbers were used since its start. Clocks may differ by kMostSkew_s.
class ProofCheck {
 public:
  static constexpr std::int64_t kMostSkew_s = 60;
  static constexpr std::size_t kMostKept = 4096;  // beyond that nobody is believed for a while

  // `hall`: its name.
  ProofCheck(std::string hall, std::string key);
  // Returns the random number of this start, hexadecimal.
  const std::string& start() const { return start_; }
  Proof check(const BusRequest& request, std::int64_t now_unix_s);

 private:
  const std::string hall_, key_, start_;
  std::map<std::string, std::int64_t> used_;  // by number, until when
};

}  // namespace trocar::hall
