#include "client/ui/banner_text.h"

#include <algorithm>
#include <cmath>

namespace trocar::ui {
namespace {

constexpr double kStaleMs = 400;

std::string tenths(double value) {
  const long whole = std::lround(value * 10);
  return std::to_string(whole / 10) + "." + std::to_string(whole % 10);
}

// Says whose tools are held back; empty: nobody's.
std::string waiting_text(const HudModel& model) {
  std::string names;
  for (const auto& who : model.participants) {
    if (!who.waits) continue;
    if (who.is_self)
      return "Your instrument is held back: it moves faster than the server can follow.";
    names += (names.empty() ? "" : ", ") + who.name;
  }
  return names.empty() ? "" : "Held back, for moving faster than the server can follow: " + names;
}

std::string waiting_advice(const HudModel& model) {
  if (model.conduct) return "Freeze holds the tools of who goes on so.";
  const bool is_own = std::ranges::any_of(model.participants,
                                          [](const auto& who) { return who.is_self && who.waits; });
  return is_own ? "Draw back a little, and go on more slowly." : "You can go on as you do.";
}

}  // namespace

std::vector<Banner> banners_of(const HudModel& model) {
  std::vector<Banner> banners;
  if (!model.status.empty()) {
    banners.push_back(
        {model.status, model.status_advice, model.is_away ? RateTone::Warning : RateTone::Calm});
    return banners;
  }
  if (!model.pace_text.empty()) banners.push_back({model.pace_text, "", RateTone::Calm});
  if (!model.frozen_text.empty())
    banners.push_back({model.frozen_text,
                       "Wait: they come back to your hands slowly when they are released.",
                       RateTone::Notice});
  if (model.has_loan && model.frozen_text.empty())
    banners.push_back(
        {"You have been handed an instrument that holds tissue.",
         "It moves from where it is as your hand moves. To open it, press and let go.",
         RateTone::Notice});
  if (std::ranges::any_of(model.participants,
                          [](const auto& who) { return who.is_self && who.is_inside; }))
    banners.push_back({"Your instrument is inside the tissue, and touches nothing.",
                       "Draw it out with the wheel, or move it off the organ.", RateTone::Notice});
  if (const auto waiting = waiting_text(model); !waiting.empty() && !model.timeline)
    banners.push_back({waiting, waiting_advice(model), RateTone::Notice});
  if (!model.is_paused && model.surface_age_ms && *model.surface_age_ms >= kStaleMs)
    banners.push_back({"This picture is " + tenths(*model.surface_age_ms * 1e-3) + " s old.",
                       "The connection is slow or has stopped: wait before you cut.",
                       RateTone::Warning});
  // A recording plays at its own speed, however slow the session was.
  if (const auto slow = describe(model.figures).banner;
      !slow.empty() && !model.timeline && model.pace_text.empty())
    banners.push_back({slow, "", RateTone::Notice});
  if (!model.recording_text.empty())
    banners.push_back({model.recording_text,
                       model.has_recording_ended
                           ? "The lesson goes on without it. Tell the host to make room on the "
                             "disk, and to start the session again."
                           : "The lesson goes on. Tell the host to see to the disk.",
                       RateTone::Warning});
  if (!model.measure_text.empty()) banners.push_back({model.measure_text, "", RateTone::Calm});
  if (!model.lent_text.empty()) banners.push_back({model.lent_text, "", RateTone::Calm});
  if (!model.view_text.empty()) banners.push_back({model.view_text, "", RateTone::Calm});
  if (banners.size() > kMostBanners) banners.resize(kMostBanners);
  return banners;
}

const char* advice_after(replica::CloseKind kind) {
  switch (kind) {
    case replica::CloseKind::None:
    case replica::CloseKind::Ended:
      return "Close this window to leave.";
    case replica::CloseKind::Refused:
      return "Ask the host of the session, or close this window to leave.";
    case replica::CloseKind::Unreachable:
      return "Check the address and the network, and ask the host whether the session runs. Close "
             "this window to leave.";
    case replica::CloseKind::Lost:
      return "Ask the host to start the session again, and join again. Close this window to leave.";
  }
  return "";
}

std::string describe_notice(const replica::Notice& notice, bool is_own, float reach_m) {
  if (!is_own || notice.is_for_all) return notice.text;
  const std::string& holder = notice.holder;
  switch (notice.outcome) {
    case replica::ClaimOutcome::RefusedHeld:
      if (holder.empty()) return notice.text;
      return (notice.verb == tool::Verb::Cut
                  ? "The blade is stopped: " + holder + " holds the tissue ahead."
                  : holder + " holds this tissue.") +
             " Wait, or ask " + holder + " to let go.";
    case replica::ClaimOutcome::RefusedNothingInReach:
      return "Nothing is in reach. Bring the tip within " +
             std::to_string(std::lround(reach_m * 1000)) + " mm of the surface.";
    case replica::ClaimOutcome::TakenOver:
      if (holder.empty()) return notice.text;
      return holder + " has taken your tissue, because your hand was silent. Ask " + holder +
             " to let go.";
    case replica::ClaimOutcome::Expired:
      return "Your tool let go, because your hand was silent for too long. Grasp or push again.";
    case replica::ClaimOutcome::Slipped:
      return "The tissue slipped out of your jaws. Grasp again, and pull less.";
    case replica::ClaimOutcome::Granted:
    case replica::ClaimOutcome::Released:
      break;
  }
  return notice.text;
}

}  // namespace trocar::ui
