#pragma once

// Asks a hall over HTTP, one request at a time; waits for the answer.

#include <chrono>
#include <cstdint>
#include <string>

#include "common/base/json.h"
#include "common/base/result.h"

namespace trocar::app {

class HallClient {
 public:
  // `key`: empty if there is none.
  HallClient(std::string host, std::uint16_t port, std::string key)
      : host_(std::move(host)), port_(port), key_(std::move(key)) {}

  // `method`: GET, POST or DELETE. ErrorCode::Refused with the hall's own line if it says no,
  // ErrorCode::ResourceMissing if there is no hall, ErrorCode::BadMessage for what is no answer of
  // one (1 MiB of JSON at most).
  Result<Json> ask(const std::string& method, const std::string& path, const std::string& body,
                   std::chrono::seconds deadline) const;

 private:
  const std::string host_;
  const std::uint16_t port_;
  const std::string key_;
};

}  // namespace trocar::app
