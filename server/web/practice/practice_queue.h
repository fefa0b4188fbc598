#pragma once

// People who practise alone, each in a session of their own, and those who wait until the machine
// has room for one more, in the order in which they came. A ticket is how a page names its visitor.
//
// Whoever waits has to ask again and again, or loses the place. A session is over when its time is,
// when nobody has done anything in it for a while, and when its visitor has left and stays away.
//
// Times are seconds of one steady clock, which the caller tells. Bounds: kMostWaiting people who
// wait, and kMostPerAddress who wait or practise, from one address.

#include <cstdint>
#include <functional>
#include <list>
#include <optional>
#include <string>
#include <vector>

namespace trocar::practice {

inline constexpr std::size_t kMostWaiting = 64;
inline constexpr int kMostPerAddress = 16;
// Whoever waits and does not ask for so long has gone.
inline constexpr double kGoneAfter_s = 10;
// Whoever has a session and is not in it: at first, and when the connection broke.
inline constexpr double kAwayAfter_s = 40;
// Whoever had a session may ask for so long why it is over.
inline constexpr double kToldFor_s = 300;

struct Limits {
  double longest_s = 1800, idle_s = 180;
};

enum class Step : std::uint8_t { Waiting, Starting, Practising, Over };

struct Visitor {
  std::string ticket, address;
  Step step = Step::Waiting;
  double asked_s = 0, begun_s = 0, here_s = 0, over_s = 0;  // here: was last in the session
  std::string name;                                         // of the session, as the hall has it
  std::string session, code;  // "HOST:PORT" and join code, once it runs
  std::string why;            // one line, when it is over
};

// This is known of the people in a session.
struct Use {
  int people = 0;
  double deed_s = 0;  // somebody has done something then
};

class PracticeQueue {
 public:
  explicit PracticeQueue(Limits limits) : limits_(limits) {}

  // Finds the visitor of a ticket; an empty or unknown one is a newcomer, who gets `fresh`. Null:
  // there is no room for a newcomer.
  const Visitor* ask(const std::string& ticket, const std::string& fresh,
                     const std::string& address, double now_s);
  // The first who waits begins; null: nobody waits, or somebody is beginning already.
  Visitor* begin_next(double now_s);
  // The session that was to begin did not: its visitor is the first in the queue again.
  void put_back(const std::string& ticket);
  // It runs: the visitor's time begins.
  void set_running(const std::string& ticket, std::string session, std::string code, double now_s);
  // Returns the names of sessions that are over from now on, and forgets who has gone.
  std::vector<std::string> end_those_over(
      double now_s, const std::function<Use(const std::string& session)>& use_of);
  // All are over, for that reason; returns as above.
  std::vector<std::string> end_all(const std::string& why, double now_s);

  // 1 is the next; 0: the visitor does not wait.
  int number_of(const Visitor& visitor) const;
  // The longest time until then, if all use the time that they have; nothing: no session here ends.
  std::optional<double> wait_s(const Visitor& visitor, double now_s) const;
  // Returns the time of a session, until it is over at the latest.
  double left_s(const Visitor& visitor, double now_s) const;
  const Visitor* find(const std::string& ticket) const;  // null: nobody
  std::size_t waiting() const;
  std::size_t practising() const;

 private:
  std::string why_over(Visitor& visitor, double now_s, const Use& use) const;

  const Limits limits_;
  std::list<Visitor> visitors_;  // in the order in which they came
};

}  // namespace trocar::practice
