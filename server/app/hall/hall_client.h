#pragma once

// Asks a hall, one request at a time, and waits for the answer: over HTTP, or over a bus.

#include <chrono>
#include <cstdint>
#include <string>

#include "common/base/bytes.h"
#include "common/base/json.h"
#include "common/base/result.h"
#include "common/secure/tls.h"
#include "server/bus/bus.h"

namespace trocar::app {

class HallConnection {
 public:
  virtual ~HallConnection() = default;
  // `method`: GET, POST or DELETE. ErrorCode::Refused with the hall's own line if it says no,
  // ErrorCode::ResourceMissing if there is no hall, ErrorCode::BadMessage for what is no answer of
  // one (1 MiB of JSON at most).
  virtual Result<Json> ask(const std::string& method, const std::string& path,
                           const std::string& body, std::chrono::seconds deadline) const = 0;
};

class HallClient final : public HallConnection {
 public:
  // `key`: empty if there is none. `tls` null: without. `certificate_der`: as http::Question has
  // it.
  HallClient(std::string host, std::uint16_t port, std::string key, secure::TlsContext tls,
             Bytes certificate_der)
      : host_(std::move(host)),
        port_(port),
        key_(std::move(key)),
        tls_(std::move(tls)),
        certificate_der_(std::move(certificate_der)) {}

  Result<Json> ask(const std::string& method, const std::string& path, const std::string& body,
                   std::chrono::seconds deadline) const override;

 private:
  const std::string host_;
  const std::uint16_t port_;
  const std::string key_;
  const secure::TlsContext tls_;
  const Bytes certificate_der_;
};

class BusHallClient final : public HallConnection {
 public:
  // `bus` outlives it. `name` and `start`: the hall's, as its directory has them.
  BusHallClient(bus::Bus& bus, std::string name, std::string start, std::string key)
      : bus_(bus), name_(std::move(name)), start_(std::move(start)), key_(std::move(key)) {}

  Result<Json> ask(const std::string& method, const std::string& path, const std::string& body,
                   std::chrono::seconds deadline) const override;

 private:
  bus::Bus& bus_;
  const std::string name_, start_, key_;
};

}  // namespace trocar::app
