#include "server/tissue/thread/rules_toml.h"

#include "common/tool/toml_reader.h"

namespace trocar::thread {
namespace {

constexpr std::size_t kFileLimitBytes = 1024 * 1024;

std::string table_entry(const char* table, std::size_t i) {
  return std::string(table) + "[" + std::to_string(i) + "]";
}

Vec3d read_near(tool::TableReader& reader, std::string_view key) {
  const auto mm = reader.vector(key);
  if (!mm)
    reader.fail_missing(key, "write [x, y, z]");
  else if (length(*mm) > kMostM * 1e3)
    reader.fail(key, "is more than 2 m away: is it in millimetres?");
  return mm.value_or(Vec3d{}) * 1e-3;
}

std::optional<Vec3d> read_limited(tool::TableReader& reader, const std::string& key, double most,
                                  const char* unit) {
  const auto value = reader.vector(key);
  if (value && length(*value) > most)
    reader.fail(key, "is longer than " + tool::shown(most) + " " + unit);
  return value;
}

struct EndKeys {
  std::string held, load, velocity, until;
};

End read_end(tool::TableReader& reader, const EndKeys& keys) {
  End end;
  end.is_held = reader.boolean(keys.held).value_or(false);
  const auto load = read_limited(reader, keys.load, kMostLoadN, "N");
  const auto velocity = read_limited(reader, keys.velocity, kMostSpeedM_s * 1e3, "mm/s");
  if (load && end.is_held) reader.fail(keys.load, "is of a free end, remove it or " + keys.held);
  if (velocity && !end.is_held)
    reader.fail(keys.velocity, "is of a held end, write " + keys.held + " = true");
  end.load_n = load.value_or(Vec3d{});
  end.velocity_m_s = velocity.value_or(Vec3d{}) * 1e-3;
  const auto until = reader.number(keys.until, 0, kMostSeconds);
  if (until && !load && !velocity)
    reader.fail(keys.until, "needs " + keys.load + " or " + keys.velocity);
  end.until_s = until.value_or(velocity ? kMostSeconds : 0);
  return end;
}

ThreadRule read_thread(tool::Document& document, tool::TableReader& reader,
                       const std::vector<ThreadRule>& before) {
  ThreadRule rule;
  rule.name = reader.string("name").value_or("thread" + std::to_string(before.size()));
  for (const auto& other : before)
    if (other.name == rule.name) reader.fail("name", "is that of another thread, change one");
  rule.material =
      reader
          .choice<Material, 4>("material", {{{"silk", Material::Silk},
                                             {"nylon", Material::Nylon},
                                             {"polyglactin", Material::Polyglactin},
                                             {"polypropylene", Material::Polypropylene}}})
          .value_or(Material::Silk);
  rule.size =
      reader
          .choice<Size, 3>("size",
                           {{{"2-0", Size::Usp2_0}, {"3-0", Size::Usp3_0}, {"4-0", Size::Usp4_0}}})
          .value_or(Size::Usp3_0);
  rule.self_friction = reader.number("self_friction", 0, 1);
  rule.start =
      read_end(reader, {"start_held", "start_load_n", "start_velocity_mm_s", "start_until_s"});
  rule.end = read_end(reader, {"end_held", "end_load_n", "end_velocity_mm_s", "end_until_s"});
  const auto points = reader.tables("point");
  if (points.size() < 2)
    reader.fail_missing("point", "write two or more [[thread.point]] with at_mm");
  for (std::size_t i = 0; i < points.size() && document.ok(); ++i) {
    tool::TableReader point(document, *points[i], reader.path_of(table_entry("point", i)));
    rule.path_m.push_back(read_near(point, "at_mm"));
    point.finish();
  }
  reader.finish();
  return rule;
}

Peg read_peg(tool::TableReader& reader) {
  Peg peg;
  peg.from_m = read_near(reader, "from_mm");
  peg.to_m = read_near(reader, "to_mm");
  const auto radius = reader.number("radius_mm", kLeastPegRadiusM * 1e3, kMostPegRadiusM * 1e3);
  if (radius) peg.radius_m = *radius * 1e-3;
  peg.friction = reader.number("friction", 0, 2).value_or(peg.friction);
  reader.finish();
  return peg;
}

}  // namespace

std::optional<Rules> read_rules(tool::Document& document, tool::TableReader& root,
                                const std::optional<Vec3d>& gravity_m_s2) {
  Rules rules;
  const auto threads = root.tables("thread"), pegs = root.tables("peg");
  for (std::size_t i = 0; i < threads.size() && document.ok(); ++i) {
    tool::TableReader reader(document, *threads[i], table_entry("thread", i));
    rules.threads.push_back(read_thread(document, reader, rules.threads));
  }
  for (std::size_t i = 0; i < pegs.size() && document.ok(); ++i) {
    tool::TableReader reader(document, *pegs[i], table_entry("peg", i));
    rules.pegs.push_back(read_peg(reader));
  }
  if (const auto* table = root.table("floor"); table != nullptr && document.ok()) {
    tool::TableReader reader(document, *table, "floor");
    const auto y_mm = reader.number("y_mm", -kMostM * 1e3, kMostM * 1e3);
    if (!y_mm) reader.fail_missing("y_mm", "write how high it is, such as -50");
    rules.floor_y_m = y_mm.value_or(0) * 1e-3;
    reader.finish();
  }
  if (threads.empty()) {
    if (!pegs.empty()) root.fail("peg", "is for threads, add a [[thread]]");
    if (rules.floor_y_m) root.fail("floor", "is for threads, add a [[thread]]");
    return std::nullopt;
  }
  if (gravity_m_s2) rules.gravity_m_s2 = *gravity_m_s2;
  if (!document.ok()) return std::nullopt;
  if (const auto valid = validate(rules); !valid) root.fail("thread", valid.error().message);
  return rules;
}

Result<Rules> read_rules_file(const std::filesystem::path& path) {
  const auto text = tool::read_text_file(path, kFileLimitBytes, "thread");
  if (!text) return text.error();
  tool::Document document(path.string());
  const auto table = tool::parse_toml(document, *text, path.string(), kFileLimitBytes, "thread",
                                      "deploy/threads/post.toml");
  if (!table) return document.error();
  tool::TableReader root(document, *table, "");
  const auto rules = read_rules(document, root, std::nullopt);
  root.finish();
  if (document.ok() && !rules) root.fail_missing("thread", "write [[thread]] and its points");
  if (!document.ok()) return document.error();
  return *rules;
}

}  // namespace trocar::thread
