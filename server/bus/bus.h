#pragma once

// A connection to NATS, over which programs on many machines tell each other things. A build
// without libnats has none, and connect() says so.
//
// A patient connection is there before its NATS is. When NATS was restarted, has refused the user,
// or has shown a wrong certificate, it is tried again after 0.25 s, then after longer pauses of up
// to 4 s, for as long as it takes; each trouble is logged once, until it is another one. What is
// published meanwhile is left out, and what was subscribed is heard again. (libnats's own way back
// is not used: it ends for good when a user was refused twice.)
//
// Texts are any bytes, at most kMostTextBytes; longer ones are not handed on. A connection does not
// hear itself.
// Threads: publish() and ask...() any one; what is subscribed is called on the library's threads,
// in order for each subject. publish() may wait for the socket, for 2 s at most.

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/bus/bus_place.h"

namespace trocar::bus {

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
  // Says whether connect() would find something wrong before it reaches out: the URL, a file, or no
  // NATS in this build.
  static Status check(const BusPlace& place);

  // `take` is kept until the end.
  Status subscribe(const std::string& subject, Take take);
  // False: there is no connection now, or the text is too long.
  bool publish(const std::string& subject, const std::string& text,
               const std::string& answer_to = "");
  // All answers that come within `wait` after the first one, which may take `first_wait`.
  std::vector<std::string> ask_all(const std::string& subject, const std::string& text,
                                   std::chrono::milliseconds wait,
                                   std::chrono::milliseconds first_wait);
  // The first answer. ErrorCode::ResourceMissing: none comes.
  Result<std::string> ask(const std::string& subject, const std::string& text,
                          std::chrono::milliseconds deadline);
  // Returns how large a text this NATS takes, in bytes; 0: there is no connection now.
  std::size_t most_bytes() const;

 private:
  struct Parts;
  explicit Bus(std::unique_ptr<Parts> parts);

  std::unique_ptr<Parts> parts_;
};

}  // namespace trocar::bus
