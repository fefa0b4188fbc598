#include "server/session/recording/thread_messages.h"

#include "proto/journal.pb.h"

namespace trocar::recording {
namespace {

using Numbers = google::protobuf::RepeatedField<double>;

void add_place(const Vec3d& place, Numbers& field) {
  for (const double value : {place.x, place.y, place.z}) field.Add(value);
}

std::optional<Vec3d> place_at(const Numbers& field, int first) {
  if (field.size() < first + 3) return std::nullopt;
  return Vec3d{field.Get(first), field.Get(first + 1), field.Get(first + 2)};
}

bool read_place(const Numbers& field, Vec3d& place) {
  const auto read = field.size() == 3 ? place_at(field, 0) : std::nullopt;
  place = read.value_or(Vec3d{});
  return read.has_value();
}

void write_end(const thread::End& end, proto::ThreadRules::End& message) {
  message.set_is_held(end.is_held);
  add_place(end.velocity_m_s, *message.mutable_velocity_m_s());
  add_place(end.load_n, *message.mutable_load_n());
  message.set_until_s(end.until_s);
}

bool read_end(const proto::ThreadRules::End& message, thread::End& end) {
  end.is_held = message.is_held();
  end.until_s = message.until_s();
  return read_place(message.velocity_m_s(), end.velocity_m_s) &&
         read_place(message.load_n(), end.load_n);
}

std::optional<thread::ThreadRule> read_thread(const proto::ThreadRules::Thread& message) {
  if (message.material() >= thread::kMaterialNames.size() ||
      message.size() >= thread::kSizeNames.size() || message.path_m_size() % 3 != 0)
    return std::nullopt;
  thread::ThreadRule rule{.name = message.name(),
                          .material = static_cast<thread::Material>(message.material()),
                          .size = static_cast<thread::Size>(message.size()),
                          .path_m = {},
                          .self_friction = {},
                          .start = {},
                          .end = {}};
  for (int i = 0; i < message.path_m_size(); i += 3)
    rule.path_m.push_back(*place_at(message.path_m(), i));
  if (message.has_self_friction()) rule.self_friction = message.self_friction();
  if (!read_end(message.start(), rule.start) || !read_end(message.end(), rule.end))
    return std::nullopt;
  return rule;
}

}  // namespace

void to_message(const thread::Rules& rules, proto::ThreadRules& message) {
  for (const auto& rule : rules.threads) {
    auto& entry = *message.add_thread();
    entry.set_name(rule.name);
    entry.set_material(static_cast<std::uint32_t>(rule.material));
    entry.set_size(static_cast<std::uint32_t>(rule.size));
    for (const auto& point : rule.path_m) add_place(point, *entry.mutable_path_m());
    if (rule.self_friction) entry.set_self_friction(*rule.self_friction);
    write_end(rule.start, *entry.mutable_start());
    write_end(rule.end, *entry.mutable_end());
  }
  for (const auto& peg : rules.pegs) {
    auto& entry = *message.add_peg();
    add_place(peg.from_m, *entry.mutable_from_m());
    add_place(peg.to_m, *entry.mutable_to_m());
    entry.set_radius_m(peg.radius_m);
    entry.set_friction(peg.friction);
  }
  if (rules.floor_y_m) message.set_floor_y_m(*rules.floor_y_m);
  add_place(rules.gravity_m_s2, *message.mutable_gravity_m_s2());
}

Result<thread::Rules> from_message(const proto::ThreadRules& message) {
  thread::Rules rules;
  for (const auto& entry : message.thread()) {
    auto rule = read_thread(entry);
    if (!rule)
      return Error{ErrorCode::BadFile,
                   "thread: material, size, path_m or an end is not as it may be"};
    rules.threads.push_back(*std::move(rule));
  }
  for (const auto& entry : message.peg()) {
    thread::Peg peg{
        .from_m = {}, .to_m = {}, .radius_m = entry.radius_m(), .friction = entry.friction()};
    if (!read_place(entry.from_m(), peg.from_m) || !read_place(entry.to_m(), peg.to_m))
      return Error{ErrorCode::BadFile, "peg.from_m, to_m: are not three numbers each"};
    rules.pegs.push_back(peg);
  }
  if (message.has_floor_y_m()) rules.floor_y_m = message.floor_y_m();
  if (!read_place(message.gravity_m_s2(), rules.gravity_m_s2))
    return Error{ErrorCode::BadFile, "gravity_m_s2: is not three numbers"};
  if (const auto valid = thread::validate(rules); !valid) return valid.error();
  return rules;
}

Result<std::optional<thread::Rules>> recorded_threads(journal::SessionJournal& journal,
                                                      const std::string& path) {
  const auto message = journal.threads();
  if (!message) return message.error();
  if (!*message) return std::optional<thread::Rules>();
  auto rules = from_message(**message);
  if (!rules) return Error{rules.error().code, path + ": /threads: " + rules.error().message};
  return std::optional<thread::Rules>(std::move(*rules));
}

}  // namespace trocar::recording
