#pragma once

// States of the organ that instructors mark and return to. The first mark has no name.

#include <array>

#include "server/session/replication/audience.h"

namespace trocar::proto {
class MarkRequest;
}

namespace trocar::replication {

class Marks {
 public:
  explicit Marks(SessionContext& session) : session_(session) {}

  // `is_paused`: the session stands still, so that a mark may be pending for long.
  std::optional<Ending> ask(const Speaker& who, const proto::MarkRequest& request, bool is_paused);
  // Tells everybody, and the recording, what became of one.
  void note(const step::MarkEvent& event);
  // Tells a newcomer which there are; false: there is no room for it.
  bool show(const Speaker& newcomer) const;

 private:
  // Returns its number, or why there is none.
  Result<std::size_t> number_of(const std::string& name, bool is_return) const;
  wire::SharedBytes list() const;

  SessionContext& session_;
  std::optional<std::uint64_t> last_ns_;
  std::array<std::string, hands::kMostMarks> names_;
  std::array<bool, hands::kMostMarks> is_set_{};
  bool is_pending_ = false;  // the simulation has not said yet what became of it
};

}  // namespace trocar::replication
