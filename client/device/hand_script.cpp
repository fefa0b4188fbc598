#include "client/device/hand_script.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numbers>
#include <sstream>

#include "client/device/device_checks.h"
#include "common/base/printable.h"

namespace trocar::device {
namespace {

constexpr double kRampS = 0.5, kPauseS = 1, kTapS = 0.12;
constexpr double kDeepestM = 0.1, kLongestHoldS = 3600, kFastestHz = 20;
constexpr std::size_t kMostKeys = 100'000;
constexpr std::uintmax_t kMostBytes = 10'000'000;

Error bad(const std::string& what) {
  return {ErrorCode::Usage, what};
}

// Goes from 0 at 0 to 1 at 1 with the least jerk, from rest to rest.
double smooth(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * t * (10 + t * (6 * t - 15));
}

bool is_number(std::string_view text, double& value) {
  const auto end = text.data() + text.size();
  const auto [stop, failure] = std::from_chars(text.data(), end, value);
  return failure == std::errc{} && stop == end && std::isfinite(value);
}

// Returns true if `text` is a number in `unit` within (0, most].
bool is_quantity(std::string_view text, std::string_view unit, double scale, double most,
                 double& value) {
  if (!text.ends_with(unit)) return false;
  double number = 0;
  if (!is_number(text.substr(0, text.size() - unit.size()), number)) return false;
  if (!(number > 0 && number * scale <= most)) return false;
  value = number * scale;
  return true;
}

Result<std::string> read_text(const std::string& path) {
  std::error_code failure;
  const auto bytes = std::filesystem::file_size(path, failure);
  if (failure) return Error{ErrorCode::ResourceMissing, path + ": cannot be read, name a file"};
  if (bytes > kMostBytes)
    return Error{ErrorCode::BadFile, path + ": has more than 10 MB, shorten the path"};
  std::ifstream file(path, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(file), {}};
  if (file.bad()) return Error{ErrorCode::ResourceMissing, path + ": cannot be read, try again"};
  return text;
}

}  // namespace

Result<HandScript> HandScript::parse(std::string_view parameters) {
  if (parameters.starts_with("path=")) {
    const std::string path(parameters.substr(5));
    const auto text = read_text(path);
    if (!text) return text.error();
    return parse_keys(*text, path);
  }
  HandScript script;
  int lengths = 0;
  bool is_first = true;
  while (is_first || !parameters.empty()) {
    const auto comma = std::min(parameters.find(','), parameters.size());
    const auto word = parameters.substr(0, comma);
    parameters.remove_prefix(std::min(comma + 1, parameters.size()));
    if (!is_first) {
      if (auto status = script.set(word, lengths); !status) return status.error();
      continue;
    }
    is_first = false;
    if (word == "still")
      script.kind_ = Kind::Still;
    else if (word == "press")
      script.kind_ = Kind::Press;
    else if (word == "palpate")
      script.kind_ = Kind::Palpate;
    else if (word == "tap")
      script.kind_ = Kind::Tap;
    else
      return bad("\"" + printable(word, 40) +
                 "\" is no motion of a hand, write still, press, palpate, tap or path=FILE");
  }
  if (lengths < 2) script.mean_m_ = script.depth_m_;
  if (lengths == 2 && script.kind_ != Kind::Palpate)
    return bad("two lengths are given, leave one out: only palpate has two");
  return script;
}

Status HandScript::set(std::string_view parameter, int& lengths) {
  static constexpr std::string_view kAxes = "xyz";
  if (parameter == "grip") {
    gripper_ = 1;
  } else if (double length_m = 0;
             is_quantity(parameter, "mm", 1e-3, kDeepestM, length_m) && lengths < 2) {
    (lengths++ == 0 ? depth_m_ : mean_m_) = length_m;
  } else if (is_quantity(parameter, "Hz", 1, kFastestHz, rate_hz_) ||
             is_quantity(parameter, "s", 1, kLongestHoldS, hold_s_)) {
    return {};
  } else if (parameter.size() == 2 && (parameter[0] == '+' || parameter[0] == '-') &&
             kAxes.find(parameter[1]) != std::string_view::npos) {
    const double sign = parameter[0] == '+' ? 1 : -1;
    inwards_ = Vec3d{parameter[1] == 'x' ? sign : 0, parameter[1] == 'y' ? sign : 0,
                     parameter[1] == 'z' ? sign : 0};
  } else {
    return bad("\"" + printable(parameter, 40) +
               "\" is no parameter of a hand, write for example 5mm (at most 100), 1Hz (at most "
               "20), 2s, -y or grip");
  }
  return {};
}

Result<HandScript> HandScript::parse_keys(std::string_view text, const std::string& source) {
  HandScript script;
  script.kind_ = Kind::Path;
  std::istringstream lines{std::string(text)};
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    const auto where = [&] { return source + ":" + std::to_string(number) + ": "; };
    line.resize(std::min(line.find('#'), line.size()));
    std::istringstream words(line);
    std::vector<double> values;
    for (std::string word; words >> word && values.size() < 6;) {
      double value = 0;
      if (!is_number(word, value))
        return Error{ErrorCode::BadFile, where() + "\"" + printable(word, 40) +
                                             "\" is no number, write seconds x y z [gripper]"};
      values.push_back(value);
    }
    if (values.empty()) continue;
    if (values.size() < 4 || values.size() > 5)
      return Error{ErrorCode::BadFile,
                   where() + "has not four or five numbers, write seconds x y z [gripper]"};
    const Key key{values[0], Vec3d{values[1], values[2], values[3]} * 1e-3,
                  values.size() == 5 ? static_cast<float>(values[4]) : 0.0f};
    if (!(length(key.position_m) <= kFarthestM))
      return Error{ErrorCode::BadFile, where() + "lies more than 2000 mm away, move it nearer"};
    if (!(key.gripper >= 0 && key.gripper <= 1))
      return Error{ErrorCode::BadFile, where() + "the gripper is not between 0 and 1, correct it"};
    if (!(key.seconds >= 0 && (script.keys_.empty() || key.seconds > script.keys_.back().seconds)))
      return Error{ErrorCode::BadFile, where() + "the time does not grow, sort the lines"};
    if (script.keys_.size() == kMostKeys)
      return Error{ErrorCode::BadFile, where() + "is one line too many, 100000 are the most"};
    script.keys_.push_back(key);
  }
  if (script.keys_.empty())
    return Error{ErrorCode::BadFile, source + ": has no key frame, write seconds x y z [gripper]"};
  return script;
}

double HandScript::depth_m(double seconds) const {
  switch (kind_) {
    case Kind::Still:
    case Kind::Path:
      return 0;
    case Kind::Press: {
      const double t = std::fmod(seconds, 2 * kRampS + hold_s_ + kPauseS);
      return depth_m_ * (smooth(t / kRampS) - smooth((t - kRampS - hold_s_) / kRampS));
    }
    case Kind::Palpate:
      return smooth(seconds / kRampS) *
             (mean_m_ - depth_m_ * std::cos(2 * std::numbers::pi * rate_hz_ * seconds));
    case Kind::Tap: {
      const double length_s = std::min(kTapS, 0.5 / rate_hz_);
      const double t = std::fmod(seconds, 1 / rate_hz_) / length_s;
      return t >= 1 ? 0 : depth_m_ * std::pow(std::sin(std::numbers::pi * t), 2);
    }
  }
  return 0;
}

std::size_t HandScript::key_before(double seconds, double& share) const {
  const auto after = std::ranges::upper_bound(keys_, seconds, {}, &Key::seconds);
  share = 0;
  if (after == keys_.begin()) return 0;
  const std::size_t index = static_cast<std::size_t>(after - keys_.begin()) - 1;
  if (after != keys_.end())
    share = (seconds - keys_[index].seconds) / (after->seconds - keys_[index].seconds);
  return index;
}

Vec3d HandScript::position_m(double seconds) const {
  if (kind_ != Kind::Path) return inwards_ * depth_m(seconds);
  double share = 0;
  const std::size_t i = key_before(seconds, share);
  const Vec3d& from = keys_[i].position_m;
  return share == 0 ? from : from + (keys_[i + 1].position_m - from) * share;
}

float HandScript::gripper(double seconds) const {
  if (kind_ != Kind::Path) return gripper_;
  double share = 0;
  const std::size_t i = key_before(seconds, share);
  const float from = keys_[i].gripper;
  return share == 0 ? from : from + (keys_[i + 1].gripper - from) * static_cast<float>(share);
}

}  // namespace trocar::device
