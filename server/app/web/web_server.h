#pragma once

// trocar-web's listeners: one for browsers, one for monitoring, on one I/O thread.
//
// Requests: GET and HEAD of the page's files, /recordings (a list), /recordings/NAME (with ranges),
// /recordings/NAME/check (asks whether it verifies) and /recordings/NAME/checked (what is known of
// that), /links?session=NAME, /practice?ticket=TICKET, and the WebSocket /session. Recordings and
// practice need the key of their link, links the code of an instructor who is in the session from
// here. Bounds: connections in all and from one address, 8 KiB of header, no body, 10 s for a
// request, 30 s for 64 KiB of an answer.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/io_context.hpp>
#include <memory>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/secure/tls.h"
#include "server/app/web/options.h"
#include "server/watch/page/watcher.h"
#include "server/web/site/page_files.h"
#include "server/web/site/recordings.h"

namespace trocar::app {

struct WebCounters {
  std::uint64_t requests = 0, not_found = 0, forbidden = 0, malformed = 0;
  std::uint64_t recording_bytes = 0;
};

struct WebContent {
  site::PageFiles page;
  std::optional<site::Recordings> recordings;
  std::filesystem::path state_folder;  // where there are recordings
  std::string recordings_key;  // that a request has to name; never empty where there are recordings
  std::string practice_key;    // likewise, where people practise
};

class WebServer {
 public:
  // An error if the port is taken. `tls` null: without TLS.
  static Result<std::unique_ptr<WebServer>> listen(asio::io_context& context,
                                                   const WebOptions& options, WebContent content,
                                                   secure::TlsContext tls);
  ~WebServer();

  std::uint16_t port() const;
  // 0: there are none.
  std::uint16_t metrics_port() const;
  void start();
  // Ends all connections.
  void stop();

 private:
  struct Core;
  explicit WebServer(std::shared_ptr<Core> core) : core_(std::move(core)) {}

  std::shared_ptr<Core> core_;
};

}  // namespace trocar::app
