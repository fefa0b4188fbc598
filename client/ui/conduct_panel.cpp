// The instructor's panel: time, marks, the tools of others, and the end of the session.

#include <array>
#include <cstdio>

#include "client/ui/hud_panels.h"
#include "client/ui/panel_style.h"
#include "common/wire/lesson.h"

namespace trocar::ui {
namespace {

using replica::LeadAction;
using replica::LeadWish;

void draw_pace(const HudConduct& conduct, HudActions& actions) {
  if (ImGui::Button(conduct.is_paused ? "Go on (P)" : "Pause all (P)"))
    actions.lead =
        LeadWish{.action = conduct.is_paused ? LeadAction::GoOn : LeadAction::Pause, .name = {}};
  for (const float rate : {1.0f, 0.5f, wire::kLeastPace}) {
    ImGui::SameLine();
    char text[16];
    std::snprintf(text, sizeof text, "%.0f %%", 100 * static_cast<double>(rate));
    const bool is_chosen = conduct.rate == rate;
    if (is_chosen) ImGui::PushStyleColor(ImGuiCol_Text, kGood);
    if (ImGui::Button(text))
      actions.lead = LeadWish{.action = LeadAction::Slow, .name = {}, .rate = rate};
    if (is_chosen) ImGui::PopStyleColor();
  }
}

void draw_marks(const HudConduct& conduct, float scale, HudActions& actions) {
  // It keeps what is being typed; there is one panel.
  static std::array<char, wire::kMostMarkName + 1> name{};
  ImGui::SetNextItemWidth(150 * scale);
  ImGui::InputTextWithHint("##mark", "name of a mark", name.data(), name.size());
  ImGui::SameLine();
  if (ImGui::Button("Mark")) {
    actions.mark_named = name.data();
    name.fill(0);
  }
  for (std::size_t i = 0; i < conduct.marks.size(); ++i) {
    ImGui::PushID(static_cast<int>(i));
    const auto& mark = conduct.marks[i];
    if (ImGui::Button(("Return to " + (mark.empty() ? "the mark" : mark)).c_str()))
      actions.return_to_named = mark;
    ImGui::PopID();
  }
}

// A line says which instrument goes to whom; what goes to the instructor is taken over.
void draw_handover(const HudConduct& conduct, const HudHand& hand, HudActions& actions) {
  if (ImGui::SmallButton("Hand over")) ImGui::OpenPopup("hand over");
  if (!ImGui::BeginPopup("hand over")) return;
  for (const auto& receiver : conduct.hands)
    for (std::size_t i = 0; receiver.slot != hand.slot && i < hand.instruments.size(); ++i) {
      const auto instrument = hand.instruments[i] + (i == 0 ? " (right hand)" : " (left hand)");
      const auto line = receiver.slot == conduct.own ? "take over " + instrument
                                                     : instrument + " to " + receiver.name;
      if (!ImGui::Selectable(line.c_str())) continue;
      actions.lead = LeadWish{.action = LeadAction::HandOver,
                              .participant = hand.slot,
                              .name = hand.name,
                              .tool = static_cast<int>(i),
                              .receiver = receiver.slot,
                              .receiver_name = receiver.name};
    }
  ImGui::EndPopup();
}

void draw_hands(const HudConduct& conduct, HudActions& actions) {
  for (const auto& hand : conduct.hands) {
    ImGui::PushID(hand.slot.value);
    ImGui::TextUnformatted(hand.name.c_str());
    ImGui::SameLine();
    const auto act = [&](LeadAction action) {
      actions.lead = LeadWish{.action = action, .participant = hand.slot, .name = hand.name};
    };
    if (ImGui::SmallButton(hand.is_frozen ? "Release" : "Freeze"))
      act(hand.is_frozen ? LeadAction::Release : LeadAction::Freeze);
    ImGui::SameLine();
    if (ImGui::SmallButton("Make let go")) act(LeadAction::TakeClaim);
    if (conduct.hands.size() > 1) {
      ImGui::SameLine();
      draw_handover(conduct, hand, actions);
    }
    ImGui::PopID();
  }
}

}  // namespace

Box draw_conduct(const HudConduct& conduct, const Box& session, float scale, HudActions& actions) {
  ImGui::SetNextWindowPos({kMargin * scale, session.bottom + kMargin * scale});
  ImGui::Begin("conduct", nullptr, kPanel);
  heading("Lead");
  draw_pace(conduct, actions);
  ImGui::Separator();
  draw_marks(conduct, scale, actions);
  if (!conduct.hands.empty()) ImGui::Separator();
  draw_hands(conduct, actions);
  ImGui::Separator();
  if (ImGui::Button("End session")) ImGui::OpenPopup("end");
  if (ImGui::BeginPopup("end")) {
    ImGui::TextUnformatted("End the session for everybody?");
    if (ImGui::Button("End for everybody")) {
      actions.lead = LeadWish{.action = LeadAction::End, .name = {}};
      ImGui::CloseCurrentPopup();
    }
    ImGui::EndPopup();
  }
  const Box box = box_of_window();
  ImGui::End();
  return box;
}

}  // namespace trocar::ui
