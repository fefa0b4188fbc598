#pragma once

// Whom an instructor lets in: the session may be closed to newcomers, and who was put out does not
// come back with the same code. Who has to wait is listed by name; an instructor admits one of
// them, who then comes in once, whatever the code. Instructors pass a closed door, so that it can
// always be opened again.
//
// Codes are kept by their number, in sessions without codes names instead. All lists are bounded,
// and the oldest entry makes room. Thread: the I/O thread.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/session/access/gate.h"

namespace trocar::access {

class Door {
 public:
  static constexpr std::size_t kMostWaiting = 16, kMostAdmitted = 16, kMostPutOut = 256;

  void set_closed(bool is_closed) { is_closed_ = is_closed; }
  bool is_closed() const { return is_closed_; }
  void put_out(const Applicant& who);
  // False: nobody of that name waits.
  bool admit(const std::string& name);

  // Returns what a newcomer with a good code and a valid name is told if he has to wait; nothing:
  // he may come in.
  std::optional<std::string> check(const Applicant& who);
  // He has come in.
  void note_entry(const std::string& name);
  const std::vector<std::string>& waiting() const { return waiting_; }

 private:
  struct PutOut {
    std::uint32_t code = 0;  // 0: he came without one
    std::string name;        // then
  };

  bool is_put_out(const Applicant& who) const;

  bool is_closed_ = false;
  std::vector<PutOut> put_out_;
  std::vector<std::string> admitted_, waiting_;
};

}  // namespace trocar::access
