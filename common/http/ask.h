#pragma once

// One request to another program over HTTP, with TLS or without, and its answer.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <chrono>
#include <cstdint>
#include <string>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/http/stream.h"
#include "common/secure/tls.h"

namespace trocar::http {

struct Question {
  std::string host;
  std::uint16_t port = 0;
  std::string method, path;          // GET, POST or DELETE
  std::string body;                  // JSON
  std::string key;                   // as a bearer's token; empty: none
  std::chrono::seconds deadline{5};  // for all of it, after the host's name is looked up
  secure::TlsContext tls;            // null: without TLS
  Bytes certificate_der;             // what it has to show; empty: what `tls` trusts, of this host
};

inline constexpr std::size_t kMostAnswerBytes = 1u << 20;

// Runs on the coroutine's executor. ErrorCode::ResourceMissing with the reason if nothing answers
// in time, or what answers speaks no HTTP, or says more than kMostAnswerBytes; ErrorCode::Refused
// if its certificate is a wrong one, and then nothing was asked. The deadline does
// not hold for the name: its servers have their own. An address needs none.
asio::awaitable<Result<Answer>> ask(Question question);
// The same for who has no I/O thread: returns when there is the answer, or the error.
Result<Answer> ask_and_wait(Question question);

}  // namespace trocar::http
