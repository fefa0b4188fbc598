#pragma once

// The sessions that a program follows: where each of them is, also by what its Welcome says, which
// certificates were seen, and what has come of all together. Thread: that of the links.

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/base/bytes.h"
#include "common/secure/join_code.h"
#include "common/secure/tls.h"

namespace trocar::follow {

struct SessionAddress {
  std::string name;  // "HOST:PORT", as links have it
  std::string host;
  std::uint16_t port = 0;
};

class Sessions {
 public:
  explicit Sessions(std::vector<SessionAddress> known);

  // Empty: the first; null: there is no such session.
  const SessionAddress* find(const std::string& name) const;
  // A session comes or goes; one that is known already stays.
  void add(SessionAddress session);
  void remove(const std::string& name);
  // Other addresses of a session, as its Welcome names them: they are tried when its own does not
  // answer. At most kMostFurther of a session are kept; what is no HOST:PORT is left out.
  static constexpr std::size_t kMostFurther = 8;
  struct Further {
    secure::HalfCode code{};  // of the certificate that has named them
    std::vector<SessionAddress> places;
  };
  void note_further(const std::string& session, const secure::HalfCode& code,
                    const std::string& address);
  const Further& further_of(const std::string& session) const;
  const secure::TlsContext& tls() const { return tls_; }
  // The half code of a certificate takes 40 ms to find: it is kept for those that were seen.
  secure::HalfCode code_of(BytesView der);

  std::uint64_t messages = 0, bytes = 0;  // that came over all links

 private:
  std::vector<SessionAddress> known_;
  secure::TlsContext tls_;
  std::map<Bytes, secure::HalfCode> certificates_;
  std::map<std::string, Further> further_;  // by the session's name
};

}  // namespace trocar::follow
