#pragma once

// Servers and clients with TLS for tests: one certificate per process, and a client of blocking
// calls that may misbehave.

#include <filesystem>
#include <memory>

#include "common/secure/certificate.h"
#include "common/secure/tls.h"
#include "server/session/access/gate.h"
#include "tests/network/session_fixture.h"

namespace trocar::testing {

// A folder of mode 0700 that goes with its test.
class PrivateFolder {
 public:
  PrivateFolder();
  ~PrivateFolder();
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

// Made once per process; `number` 0 or 1.
const secure::Identity& identity(int number = 0);
// Belongs to the certificate of identity(number).
secure::HalfCode certificate_code(int number = 0);
net::TcpServerOptions tls_options(int number = 0);

// A session behind TLS and a gate with one code for each role. Its clocks are the test's.
class GuardedSession {
 public:
  explicit GuardedSession(std::int64_t uses = -1, net::TcpServerOptions tcp = tls_options(),
                          replication::ReplicatorOptions options = {});

  secure::JoinCode code(wire::Role role) const;
  access::GateCounters counters();
  // Lines of the audit log.
  std::vector<std::string> audit() const;

  PrivateFolder folder;
  std::atomic<std::uint64_t> clock_ns{1'000'000'000'000};
  std::atomic<std::int64_t> unix_seconds{1'000'000};
  static constexpr std::int64_t kLifetime = 3600;
  static constexpr std::uint16_t kBookPort = 1;

 private:
  std::map<wire::Role, secure::HalfCode> secrets_;
  std::unique_ptr<access::Gate> gate_;

 public:
  std::unique_ptr<LiveSession> session;
};

}  // namespace trocar::testing
