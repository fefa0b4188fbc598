#pragma once

// A server needs this before the first client comes: its identity, the codes of this run, and the
// files that go with them. An insecure server (--insecure-loopback) has none of it.
//
//   state folder (0700)   server.crt, server.key, codes.key, codes-PORT.json, places-PORT.json,
//                         audit.jsonl, lock

#include <filesystem>
#include <memory>
#include <string>

#include "common/base/result.h"
#include "common/secure/link_file.h"
#include "common/secure/tls.h"
#include "server/app/server/access_options.h"
#include "server/app/server/kept_places.h"
#include "server/session/access/gate.h"

namespace trocar::app {

class Admission {
 public:
  // Reads or makes the identity; an error if `address` is not of this machine and the options are
  // insecure.
  // is_resuming: codes and places of the server that was killed are good for this one.
  static Result<std::unique_ptr<Admission>> prepare(const AccessOptions& options,
                                                    const std::string& address,
                                                    bool is_resuming = false);
  // Says whether prepare() would succeed, without making anything.
  static Status check(const AccessOptions& options, const std::string& address);
  // Removes the link file and the places, and the codes unless they are kept.
  ~Admission();
  Admission(const Admission&) = delete;
  Admission& operator=(const Admission&) = delete;

  // Null: without TLS.
  const secure::TlsContext& tls() const { return tls_; }
  // Makes the codes once the port is known.
  Status issue_codes(std::uint16_t port);
  // Notes who has which place and token, for a server that has to go on with this session. An
  // insecure one notes nothing.
  void keep_places(std::vector<KeptPlace> places);
  // Those that the server before has left; after issue_codes().
  const std::vector<KeptPlace>& places_before() const { return places_before_; }
  const secure::HalfCode& certificate_code() const { return certificate_code_; }
  // Null: everybody may come.
  access::Gate* gate() { return gate_.get(); }
  // Says code and link of each role, a line each; nothing if insecure.
  std::string invitation(std::uint16_t port) const;

 private:
  Admission(const AccessOptions& options, std::string address, bool is_resuming)
      : options_(options), address_(std::move(address)), is_resuming_(is_resuming) {}

  Status read_identity();

  const AccessOptions options_;
  const std::string address_;
  const bool is_resuming_;
  std::filesystem::path state_;
  secure::TlsContext tls_;
  secure::HalfCode certificate_code_{};
  secure::CodesByRole codes_;
  std::filesystem::path link_file_, places_file_;
  std::vector<KeptPlace> places_, places_before_;
  std::unique_ptr<access::Gate> gate_;
};

// Does what --revoke and --new-code ask for, at the server that runs, and says so.
Status change_codes(const AccessOptions& options, const std::string& address, std::uint16_t port);

}  // namespace trocar::app
