#pragma once

// The banners say in one sentence what is not as it should be, and in one what to do about it.
// Nothing is drawn here.

#include <string>
#include <vector>

#include "client/replica/session_source.h"
#include "client/ui/hud.h"
#include "client/ui/rate_text.h"

namespace trocar::ui {

inline constexpr std::size_t kMostBanners = 3;  // the first ones matter most

struct Banner {
  std::string text, advice;  // the advice may be empty
  RateTone tone = RateTone::Warning;
};
// At most kMostBanners. A session that is over or away has one: the rest is of no use then.
std::vector<Banner> banners_of(const HudModel& model);

// Says what a person can do when a connection has ended so.
const char* advice_after(replica::CloseKind kind);

// Says what became of a claim; `reach_m` is of one's own tool. Others' claims keep the server's
// words.
std::string describe_notice(const replica::Notice& notice, bool is_own, float reach_m);

}  // namespace trocar::ui
