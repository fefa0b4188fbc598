#include "server/web/practice/practice_queue.h"

#include <algorithm>
#include <cmath>

namespace trocar::practice {
namespace {

auto has_ticket(const std::string& ticket) {
  return [&ticket](const Visitor& visitor) { return visitor.ticket == ticket; };
}

std::string minutes(double seconds) {
  if (seconds < 120) return std::to_string(std::lround(seconds)) + " seconds";
  const auto whole = std::lround(seconds / 60);
  return std::to_string(whole) + " minutes";
}

}  // namespace

const Visitor* PracticeQueue::ask(const std::string& ticket, const std::string& fresh,
                                  const std::string& address, double now_s) {
  const auto known = std::ranges::find_if(visitors_, has_ticket(ticket));
  if (known != visitors_.end()) {
    known->asked_s = now_s;
    return &*known;
  }
  const auto of_address = std::ranges::count_if(visitors_, [&](const Visitor& one) {
    return one.address == address && one.step != Step::Over;
  });
  if (waiting() >= kMostWaiting || of_address >= kMostPerAddress) return nullptr;
  visitors_.push_back({.ticket = fresh, .address = address, .asked_s = now_s});
  return &visitors_.back();
}

Visitor* PracticeQueue::begin_next(double now_s) {
  const auto begins = [](const Visitor& one) { return one.step == Step::Starting; };
  if (std::ranges::any_of(visitors_, begins)) return nullptr;
  const auto next = std::ranges::find(visitors_, Step::Waiting, &Visitor::step);
  if (next == visitors_.end()) return nullptr;
  next->step = Step::Starting;
  next->begun_s = now_s;
  return &*next;
}

void PracticeQueue::put_back(const std::string& ticket) {
  const auto found = std::ranges::find_if(visitors_, has_ticket(ticket));
  if (found == visitors_.end() || found->step != Step::Starting) return;
  found->step = Step::Waiting;
  found->name.clear();
}

void PracticeQueue::set_running(const std::string& ticket, std::string session, std::string code,
                                double now_s) {
  const auto found = std::ranges::find_if(visitors_, has_ticket(ticket));
  if (found == visitors_.end()) return;
  found->step = Step::Practising;
  found->begun_s = found->here_s = now_s;
  found->session = std::move(session);
  found->code = std::move(code);
}

std::string PracticeQueue::why_over(Visitor& visitor, double now_s, const Use& use) const {
  if (visitor.step != Step::Practising) return {};
  if (use.people > 0) visitor.here_s = now_s;
  if (now_s - visitor.begun_s >= limits_.longest_s)
    return "Your " + minutes(limits_.longest_s) + " are over.";
  if (now_s - visitor.here_s >= kAwayAfter_s) return "You were away, and the session has ended.";
  if (now_s - std::max(use.deed_s, visitor.begun_s) >= limits_.idle_s)
    return "You did nothing for " + minutes(limits_.idle_s) + ", and the session has ended.";
  return {};
}

std::vector<std::string> PracticeQueue::end_those_over(
    double now_s, const std::function<Use(const std::string& session)>& use_of) {
  std::vector<std::string> names;
  for (auto& visitor : visitors_) {
    visitor.why = visitor.step == Step::Over ? visitor.why
                                             : why_over(visitor, now_s, use_of(visitor.session));
    if (visitor.step == Step::Over || visitor.why.empty()) continue;
    visitor.step = Step::Over;
    visitor.over_s = now_s;
    names.push_back(visitor.name);
  }
  std::erase_if(visitors_, [now_s](const Visitor& one) {
    return (one.step == Step::Waiting && now_s - one.asked_s >= kGoneAfter_s) ||
           (one.step == Step::Over && now_s - one.over_s >= kToldFor_s);
  });
  return names;
}

std::vector<std::string> PracticeQueue::end_all(const std::string& why, double now_s) {
  std::vector<std::string> names;
  for (auto& visitor : visitors_) {
    if (visitor.step == Step::Over) continue;
    if (!visitor.name.empty()) names.push_back(visitor.name);
    visitor.step = Step::Over;
    visitor.over_s = now_s;
    visitor.why = why;
  }
  return names;
}

int PracticeQueue::number_of(const Visitor& visitor) const {
  if (visitor.step != Step::Waiting) return 0;
  int number = 0;
  for (const auto& one : visitors_) {
    number += one.step == Step::Waiting;
    if (&one == &visitor) break;
  }
  return number;
}

// With n sessions, the visitor of number k gets the place of the one that ends as the k-th, and
// after n of them that of one who has begun in between.
std::optional<double> PracticeQueue::wait_s(const Visitor& visitor, double now_s) const {
  const int number = number_of(visitor);
  std::vector<double> left;
  for (const auto& one : visitors_)
    if (one.step == Step::Practising || one.step == Step::Starting)
      left.push_back(left_s(one, now_s));
  if (number == 0 || left.empty()) return std::nullopt;
  std::ranges::sort(left);
  const auto before = static_cast<std::size_t>(number - 1), count = left.size();
  return left[before % count] + static_cast<double>(before / count) * limits_.longest_s;
}

double PracticeQueue::left_s(const Visitor& visitor, double now_s) const {
  return std::max(0.0, limits_.longest_s - (now_s - visitor.begun_s));
}

const Visitor* PracticeQueue::find(const std::string& ticket) const {
  const auto found = std::ranges::find_if(visitors_, has_ticket(ticket));
  return found == visitors_.end() ? nullptr : &*found;
}

std::size_t PracticeQueue::waiting() const {
  return static_cast<std::size_t>(std::ranges::count(visitors_, Step::Waiting, &Visitor::step));
}

std::size_t PracticeQueue::practising() const {
  return static_cast<std::size_t>(std::ranges::count(visitors_, Step::Practising, &Visitor::step));
}

}  // namespace trocar::practice
