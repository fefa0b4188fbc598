#include "client/net/hand_messages.h"

#include <utility>

#include "client/replica/client_messages.h"

namespace trocar::net {

void HandMessages::begin() {
  readings_ = {};
  reports_.clear();
}

void HandMessages::hear(const proto::Envelope& message) {
  figures_.hand_messages_refused += replica::pass_on(message, hands_);
}

bool HandMessages::ask(DatagramPath* datagrams, std::uint64_t now_ns) {
  bool has_more = false;
  while (const auto reading = hands_.pop_reading(now_ns)) {
    if (reading->tool >= readings_.size()) continue;
    proto::Envelope envelope;
    replica::write_reading(*reading, ++sequence_, envelope);
    if (datagrams && datagrams->carry(envelope)) continue;
    readings_[reading->tool] = wire::encode_envelope(envelope);
    has_more = true;
  }
  while (const auto report = hands_.pop_report()) {
    if (reports_.size() == kMostReports) {
      ++figures_.sends_dropped;
      continue;
    }
    proto::Envelope envelope;
    replica::write_report(*report, envelope);
    reports_.push_back(wire::encode_envelope(envelope));
    has_more = true;
  }
  return has_more;
}

void HandMessages::move_to(std::vector<wire::SharedBytes>& frames) {
  for (auto& reading : readings_)
    if (reading) frames.push_back(std::exchange(reading, nullptr));
  frames.insert(frames.end(), reports_.begin(), reports_.end());
  reports_.clear();
}

}  // namespace trocar::net
