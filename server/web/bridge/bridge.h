#pragma once

// All who watch through this program share a Bridge: it knows the sessions that may be watched, the
// carrier of each, counters, and the limit of wrong tries. Thread: that of its I/O context.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/any_io_executor.hpp>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/secure/join_code.h"
#include "common/secure/tls.h"
#include "server/session/access/try_limiter.h"

namespace trocar::bridge {

class Carrier;

struct SessionAddress {
  std::string name;  // "HOST:PORT", as links have it
  std::string host;
  std::uint16_t port = 0;
};

struct BridgeCounters {
  std::uint64_t joins = 0;        // that reached a session
  std::uint64_t refused = 0;      // by the bridge: form, code, too many tries
  std::uint64_t wrong_codes = 0;  // by bridge or session
  std::uint64_t unreachable = 0;  // sessions
  std::uint64_t session_messages = 0, session_bytes = 0;  // from sessions
  std::uint64_t messages_down = 0, bytes_down = 0;        // to browsers
  std::uint64_t messages_up = 0, bytes_up = 0;
  std::uint64_t frames_skipped = 0;  // summed over those who share a carrier
  std::size_t watchers = 0;          // now
  std::size_t carriers = 0;          // connections that many share, now
};

class Bridge {
 public:
  explicit Bridge(std::vector<SessionAddress> sessions);
  ~Bridge();

  // Empty: the first; null: there is no such session.
  const SessionAddress* find_session(const std::string& name) const;
  // The connection that those who only watch share; a new one if the last has ended.
  std::shared_ptr<Carrier> carrier_of(const SessionAddress& session,
                                      const asio::any_io_executor& executor);
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

  access::TryLimiter limiter;
  BridgeCounters counters;

 private:
  std::vector<SessionAddress> sessions_;
  secure::TlsContext tls_;
  std::map<Bytes, secure::HalfCode> known_;
  std::map<std::string, Further> further_;                  // by the session's name
  std::map<std::string, std::weak_ptr<Carrier>> carriers_;  // by the session's name
};

}  // namespace trocar::bridge
