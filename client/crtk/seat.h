#pragma once

// An arm's place in the session: one participant with one tool. Thread: one; the source has one of
// its own.

#include <cstdint>
#include <optional>
#include <string>

#include "client/net/net_source.h"
#include "client/replica/replica.h"

namespace trocar::crtk {

class Seat {
 public:
  explicit Seat(net::NetSourceOptions options);

  // Takes what has come.
  void poll() { source_.poll(replica_); }
  // Once it returns true, closed() says why.
  bool is_closed() const;
  replica::CloseReason closed() const;
  // Begins to leave.
  void leave(const std::string& why) { source_.close(why); }

  // Why the arm cannot do anything; empty: it is in the session.
  std::string fault() const;
  // Why the tool stays where it is, though the arm moves; empty: it does not.
  std::string hold() const;
  // Returns what the session has told this tool, oldest first; nothing: no more.
  std::optional<std::string> pop_told();

  // True if the sample has to go out: it differs from the last one, or that is long ago.
  bool is_due(const tool::ToolSample& sample, std::uint64_t now_ns) const;
  // How long to wait, at least, until another sample may go.
  std::uint64_t pause_ns(std::uint64_t now_ns) const;
  void send(const tool::ToolSample& sample, std::uint64_t now_ns);

  struct Seen {
    replica::Tool tool;
    Tick tick = 0;
  };
  // The tool as a frame has it that was not seen yet; nothing: there is none.
  std::optional<Seen> see_tool();

 private:
  const replica::Participant* self() const;

  net::NetSource source_;
  replica::Replica replica_;
  std::optional<tool::ToolSample> sent_;
  std::uint64_t sent_ns_ = 0, notices_ = 0;
  std::uint32_t sequence_ = 0;
  Tick seen_tick_ = 0;
};

}  // namespace trocar::crtk
