#pragma once

// A connection to NATS, over which halls tell each other and people what runs where. A build
// without libnats has none, and connect() says so.
//
// A hall's connection is patient: it is there before its NATS is, and comes back by itself when
// that was restarted; what is published meanwhile is left out. Texts are at most kMostTextBytes,
// longer ones are not handed on.
// Threads: publish() and ask...() any one; what is subscribed is called on the library's threads.

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace trocar::hall {

// Returns `url` without what stands before an @ in each of its addresses: "nats://***@HOST:PORT".
std::string without_passwords(const std::string& url);

// Names a NATS, and how one gets in.
struct BusPlace {
  std::string url;      // nats://HOST:PORT or tls://HOST:PORT, or several with commas, no user
  std::string ca_file;  // PEM of who vouches for its certificate; empty: whom this machine trusts
  std::string creds_file;  // USER:PASSWORD, or NATS's own credentials (JWT); empty: none
};

class Bus {
 public:
  static constexpr std::size_t kMostTextBytes = 256 * 1024;
  // `answer_to`: a subject; empty: nobody waits.
  using Take = std::function<void(const std::string& text, const std::string& answer_to)>;

  // ErrorCode::ResourceMissing where nobody answers, unless it is patient; ErrorCode::Refused for a
  // wrong certificate or wrong credentials, also if it is patient; ErrorCode::BadFile for a file
  // that cannot be used, or credentials that others may read; ErrorCode::Usage for a wrong URL, one
  // with a password, a certificate without tls://, or without NATS in this build. One at a time in
  // a process.
  static Result<std::unique_ptr<Bus>> connect(const BusPlace& place, const std::string& name,
                                              bool is_patient);
  ~Bus();

  // `take` is kept until the end.
  Status subscribe(const std::string& subject, Take take);
  // False: there is no connection now, or the text is too long.
  bool publish(const std::string& subject, const std::string& text);
  // All answers that come within `wait`.
  std::vector<std::string> ask_all(const std::string& subject, const std::string& text,
                                   std::chrono::milliseconds wait);
  // The first answer. ErrorCode::ResourceMissing: none comes.
  Result<std::string> ask(const std::string& subject, const std::string& text,
                          std::chrono::milliseconds deadline);

 private:
  struct Parts;
  explicit Bus(std::unique_ptr<Parts> parts);

  std::unique_ptr<Parts> parts_;
};

}  // namespace trocar::hall
