#pragma once

// All who watch through this program share a Bridge: it knows the sessions that may be watched, the
// carrier of each, counters, and the limit of wrong tries. Thread: that of its I/O context.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/any_io_executor.hpp>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/intake/room.h"
#include "server/session/access/try_limiter.h"
#include "server/watch/follow/sessions.h"
#include "server/watch/page/carrier.h"
#include "server/watch/page/page_counters.h"

namespace trocar::page {

// This is known of the people in a session.
struct SessionUse {
  int people = 0;
  std::uint64_t deed_ns = 0;  // somebody has done something then, monotonic_ns()
};

class Bridge {
 public:
  // `most_connections`: that browsers may have, in all and from one address. Observers leave some
  // of them to who leads.
  Bridge(std::vector<follow::SessionAddress> known, int most_connections,
         int most_connections_per_address);

  // The connection that those who only watch share, a new one if the last has ended; or one for an
  // instructor alone.
  std::shared_ptr<Carrier> carrier_of(const follow::SessionAddress& session, wire::Role role,
                                      const asio::any_io_executor& executor);

  // Who leads a session is in it, and has come with a code.
  void note_leader(const std::string& session, const secure::JoinCode& code);
  void forget_leader(const std::string& session, const secure::JoinCode& code);
  bool has_leader(const std::string& session, const secure::JoinCode& code) const;

  follow::Sessions sessions;
  std::shared_ptr<SessionUse> use_of(const std::string& session);  // made if there is none
  std::map<std::string, std::shared_ptr<SessionUse>> uses;         // by the session's name
  intake::Room observers;
  access::TryLimiter limiter;
  PageCounters counters;

 private:
  std::map<std::string, std::weak_ptr<Carrier>> carriers_;         // by the session's name
  std::vector<std::pair<std::string, secure::JoinCode>> leaders_;  // by the session's name
};

}  // namespace trocar::page
