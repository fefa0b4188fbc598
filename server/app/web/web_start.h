#pragma once

// Before the first browser comes, trocar-web needs the page, a certificate, the key of recordings,
// and the folder that it serves.

#include "common/base/result.h"
#include "common/secure/tls.h"
#include "server/app/web/web_server.h"

namespace trocar::app {

struct WebStart {
  WebContent content;
  secure::TlsContext tls;  // null: without
};

// Reads what is there and makes what is missing; an error names the option.
Result<WebStart> prepare_web(const WebOptions& options);
// Says whether prepare_web() would succeed, without making anything.
Status check_web_start(const WebOptions& options);

}  // namespace trocar::app
