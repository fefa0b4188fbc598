#include "client/doctor/advice.h"

#include <fmt/format.h>

#include <algorithm>

namespace trocar::doctor {
namespace {

const char* word_of(Grade grade) {
  switch (grade) {
    case Grade::Good:
      return "good";
    case Grade::Limited:
      return "limited";
    case Grade::Impossible:
      break;
  }
  return "impossible";
}

// Texts from elsewhere may lack their full stop.
std::string sentence(std::string text) {
  if (!text.empty() && text.back() != '.') text += '.';
  return text;
}

double picture_ms(const Graphics& graphics) {
  return graphics.pictures_per_second > 0 ? 1e3 / graphics.pictures_per_second : 0;
}

// From the tissue on the server to the eye, in ms.
double picture_age_ms(const Measurements& measured) {
  const auto& visit = measured.visit;
  return visit.frame_age_ms + visit.shown_later_ms + picture_ms(measured.graphics);
}

class Judgement {
 public:
  explicit Judgement(const Measurements& measured) : measured_(measured) {}

  Advice advice() {
    add_server();
    if (measured_.visit.is_joined) {
      add_way();
      add_frames();
      add_clock();
    }
    add_graphics();
    add_devices();
    add_disk();
    add_verdict();
    return std::move(advice_);
  }

 private:
  void add(std::string subject, Grade grade, std::string text, std::string advice = {}) {
    advice_.grade = std::max(advice_.grade, grade);
    advice_.findings.push_back({std::move(subject), grade, sentence(std::move(text)),
                                grade == Grade::Good ? std::string() : std::move(advice)});
  }

  void add_server() {
    const auto& visit = measured_.visit;
    if (visit.server.empty()) return;  // the machine alone is judged
    if (visit.address.empty())
      return add("server", Grade::Impossible, visit.problem,
                 "Check the name, or give the address in numbers; a school's name server may not "
                 "know it.");
    if (!visit.is_reached)
      return add("server", Grade::Impossible, visit.problem,
                 "Check that the server runs, and that its port is open for TCP and UDP in the "
                 "firewall between.");
    if (visit.lacks_code)
      return add("server", Grade::Limited,
                 fmt::format("{} ({}) answers after {:.0f} ms.", visit.server, visit.address,
                             visit.connect_ms),
                 "Give --join CODE, as the server printed it, to test the session itself.");
    if (visit.is_refused)
      return add("server", Grade::Impossible, visit.problem,
                 "Ask the teacher for the code of this session: each start of a server may have "
                 "another.");
    if (!visit.is_joined)
      return add("server", Grade::Impossible, visit.problem,
                 "Look into the server's log, and try again.");
    add("server", Grade::Good,
        fmt::format("{} ({}) takes you in; it gives '{}'.", visit.server, visit.address,
                    visit.organ));
    if (!visit.problem.empty())
      add("session", Grade::Limited, visit.problem, "Run it again while the session goes on.");
  }

  void add_way() {
    const auto& visit = measured_.visit;
    const bool is_slow = visit.round_trip_95_ms > kGoodAgeMs;
    add("round trip", is_slow ? Grade::Limited : Grade::Good,
        fmt::format("{:.0f} ms, 95 % within {:.0f} ms.", visit.round_trip_ms,
                    visit.round_trip_95_ms),
        "Use a cable instead of a radio network, and end downloads on this network.");
    if (!visit.has_datagrams)
      return add("loss", Grade::Limited, "No datagram arrives, so all goes over the stream.",
                 "Open the server's port for UDP: then a lost packet holds nothing up.");
    add("loss", visit.lost_share > kGoodLostShare ? Grade::Limited : Grade::Good,
        fmt::format("{:.1f} % of datagrams.", visit.lost_share * 1e2),
        "Use a cable, or move nearer to the radio station; others may fill the network.");
  }

  void add_frames() {
    const auto& visit = measured_.visit;
    const bool is_slow = visit.frames_share < kGoodFramesShare;
    const double kbit = visit.bytes_per_second * 8e-3;
    add("bandwidth", is_slow ? Grade::Limited : Grade::Good,
        fmt::format("{:.0f} frames a second of {:.0f} bytes, {:.0f} kbit/s; {:.0f} kB came in "
                    "{:.1f} s when joining.",
                    visit.frames_per_second, visit.frame_bytes, kbit, visit.join_bytes * 1e-3,
                    visit.join_seconds),
        fmt::format("Only {:.0f} % of the frames arrive: the network is too slow or too full.",
                    visit.frames_share * 1e2));
    if (visit.session_speed < kGoodSessionSpeed)
      add("session", Grade::Limited,
          fmt::format("It runs at {:.0f} % of real time at present.", visit.session_speed * 1e2),
          "This is the server's: it is busy, paused or slowed by the instructor.");
  }

  void add_clock() {
    const auto& visit = measured_.visit;
    if (visit.has_clock)
      add("clock", Grade::Good,
          fmt::format("The server's is known within {:.1f} ms.", visit.clock_error_ms));
  }

  void add_graphics() {
    const auto& graphics = measured_.graphics;
    if (graphics.renderer.empty())
      return add("graphics", Grade::Impossible, graphics.problem,
                 "Install a driver with OpenGL 3.3, or watch in a browser.");
    const bool is_slow =
        graphics.pictures_per_second > 0 && graphics.pictures_per_second < kGoodPicturesPerSecond;
    std::string text = graphics.renderer + (graphics.is_software ? ", in software" : "");
    if (graphics.pictures_per_second > 0)
      text += fmt::format("; {:.0f} pictures a second of this organ", graphics.pictures_per_second);
    add("graphics", is_slow ? Grade::Limited : Grade::Good, text + ".",
        graphics.is_software ? "Install the graphics driver, or make the window smaller (--size)."
                             : "Make the window smaller (--size).");
    if (!graphics.has_display)
      add("display", Grade::Limited, "There is none, so no window can be opened.",
          "Start it in a desktop session, or take part without a window (--headless).");
  }

  void add_devices() {
    std::string found;
    for (const auto& device : measured_.devices)
      if (device.is_found && device.is_real) found += (found.empty() ? "" : ", ") + device.name;
    add("devices", Grade::Good,
        found.empty() ? "No haptic device; the mouse holds an instrument."
                      : found + " can hold an instrument.");
  }

  void add_disk() {
    if (!measured_.free_bytes) return;
    const double free = *measured_.free_bytes;
    add("disk", free < kGoodFreeBytes ? Grade::Limited : Grade::Good,
        fmt::format("{:.1f} GB are free in {}.", free * 1e-9, measured_.folder),
        "Make room before you record: sessions that you host here are written there.");
  }

  void add_verdict() {
    if (advice_.grade == Grade::Impossible) {
      advice_.verdict = "You cannot take part.";
      for (const auto& finding : advice_.findings)
        if (finding.grade == Grade::Impossible) {
          advice_.verdict += " " + finding.text;
          break;
        }
      return;
    }
    if (measured_.visit.server.empty()) {
      advice_.verdict = fmt::format(
          "This machine can take part{}. No session was tried ({}): with a link, "
          "trocar-doctor --join LINK tries that, too.",
          advice_.grade == Grade::Good ? "" : ", with limits", measured_.visit.problem);
      return;
    }
    if (!measured_.visit.is_joined) {
      advice_.verdict = "You can reach the server. The session was not tried.";
      return;
    }
    const double age = picture_age_ms(measured_);
    if (age > kGoodAgeMs) {
      const std::string effect =
          age > kWorstAgeMs ? "Work will be hard." : "You will see your tools lag.";
      add("picture", Grade::Limited, fmt::format("It will be about {:.0f} ms old. {}", age, effect),
          "Better a shorter way (round trip), fewer losses or faster graphics, see above.");
    } else {
      add("picture", Grade::Good, fmt::format("It will be about {:.0f} ms old.", age));
    }
    advice_.verdict = fmt::format("You can take part{}. The picture will be about {:.0f} ms old.",
                                  advice_.grade == Grade::Good ? "" : ", with limits", age);
  }

  const Measurements& measured_;
  Advice advice_;
};

}  // namespace

Advice judge(const Measurements& measured) {
  return Judgement(measured).advice();
}

std::string to_text(const Advice& advice) {
  std::string text;
  for (const auto& finding : advice.findings) {
    text +=
        fmt::format("{:<11} {:<10} {}\n", finding.subject, word_of(finding.grade), finding.text);
    if (!finding.advice.empty()) text += fmt::format("{:<22} -> {}\n", "", finding.advice);
  }
  return text + "\n" + advice.verdict + "\n";
}

Json to_json(const Advice& advice, const Measurements& measured) {
  Json json;
  json["grade"] = word_of(advice.grade);
  json["verdict"] = advice.verdict;
  json["findings"] = Json::array();
  for (const auto& finding : advice.findings)
    json["findings"].push_back({{"subject", finding.subject},
                                {"grade", word_of(finding.grade)},
                                {"text", finding.text},
                                {"advice", finding.advice}});
  json["sessions"] = measured.sessions;
  const auto& visit = measured.visit;
  json["visit"] = {{"server", visit.server},
                   {"address", visit.address},
                   {"reached", visit.is_reached},
                   {"joined", visit.is_joined},
                   {"problem", visit.problem},
                   {"organ", visit.organ},
                   {"connect_ms", visit.connect_ms},
                   {"seconds", visit.seconds},
                   {"round_trip_median_ms", visit.round_trip_ms},
                   {"round_trip_95_ms", visit.round_trip_95_ms},
                   {"datagrams", visit.has_datagrams},
                   {"lost_percent", visit.lost_share * 1e2},
                   {"join_bytes", visit.join_bytes},
                   {"join_seconds", visit.join_seconds},
                   {"bytes_per_second", visit.bytes_per_second},
                   {"frame_bytes", visit.frame_bytes},
                   {"frames_per_second", visit.frames_per_second},
                   {"frames_percent", visit.frames_share * 1e2},
                   {"session_speed", visit.session_speed},
                   {"picture_age_ms", visit.is_joined ? Json(picture_age_ms(measured)) : Json()},
                   {"clock_offset_ms", visit.has_clock ? Json(visit.clock_offset_ms) : Json()},
                   {"clock_error_ms", visit.has_clock ? Json(visit.clock_error_ms) : Json()}};
  const auto& graphics = measured.graphics;
  json["graphics"] = {{"renderer", graphics.renderer},
                      {"problem", graphics.problem},
                      {"software", graphics.is_software},
                      {"display", graphics.has_display},
                      {"pictures_per_second", graphics.pictures_per_second}};
  json["devices"] = Json::array();
  for (const auto& device : measured.devices)
    json["devices"].push_back({{"name", device.name},
                               {"real", device.is_real},
                               {"found", device.is_found},
                               {"text", device.text}});
  json["disk"] = {{"folder", measured.folder},
                  {"free_bytes", measured.free_bytes ? Json(*measured.free_bytes) : Json()}};
  return json;
}

}  // namespace trocar::doctor
