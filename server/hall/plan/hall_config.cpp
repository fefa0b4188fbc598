#include "server/hall/plan/hall_config.h"

#include "common/base/asio.h"  // before Boost: see there

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <charconv>

#include "common/lesson/lesson.h"
#include "common/secure/loopback.h"
#include "common/tool/toml_reader.h"

namespace trocar::hall {
namespace {

constexpr std::size_t kConfigLimitBytes = 64 * 1024;
constexpr const char* kConfigExample = "deploy/trocar-hall.toml.example";
constexpr double kMostCores = 1024;

// Reads "ADDRESS:PORT" or "[IPV6]:PORT".
bool read_place(const std::string& text, std::string& address, std::uint16_t& port) {
  const auto colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) return false;
  address = text.substr(0, colon);
  if (address.starts_with('[') && address.ends_with(']'))
    address = address.substr(1, address.size() - 2);
  const char* end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data() + colon + 1, end, port);
  return !address.empty() && parsed.ec == std::errc{} && parsed.ptr == end;
}

bool is_address(const std::string& text) {
  boost::system::error_code error;
  asio::ip::make_address(text, error);
  return !error;
}

void read_ports(tool::TableReader& table, const char* key, PortRange& range) {
  const auto ports = table.integers(key);
  if (!ports) return;
  if (ports->size() != 2 || ports->front() < 1024 || ports->back() > 65535 ||
      ports->front() > ports->back())
    return table.fail(key, "is no range of ports, write [7710, 7729], within 1024 to 65535");
  range = {static_cast<std::uint16_t>(ports->front()), static_cast<std::uint16_t>(ports->back())};
}

Offer read_offer(tool::Document& document, const toml::table& at) {
  tool::TableReader table(document, at, "offer");
  Offer offer;
  if (const auto name = table.string("name")) {
    if (!is_name(*name)) table.fail("name", "is no name, write 1 to 32 of a to z, 0 to 9 and -");
    offer.name = *name;
  } else if (!table.has("name")) {
    table.fail_missing("name", "write one such as \"liver\"");
  }
  offer.lesson = table.string("lesson").value_or("");
  offer.organ = table.string("organ").value_or("");
  offer.cores = table.number("cores", 0.05, kMostCores);
  offer.workers = static_cast<unsigned>(table.integer("workers", 1, 16).value_or(1));
  offer.bleeds = table.boolean("bleeding").value_or(false);
  if (offer.lesson.empty() == offer.organ.empty())
    table.fail("", "has to have either a lesson or an organ, a lesson brings its own organ");
  table.finish();
  if (!document.ok() || offer.lesson.empty()) return offer;
  if (const auto lesson = lesson::find_lesson(offer.lesson))
    offer.organ = lesson->organ;
  else
    table.fail("lesson", lesson.error().message);
  return offer;
}

void read_access(tool::TableReader& table, HallConfig& config) {
  if (const auto listen = table.string("listen"))
    if (!read_place(*listen, config.address, config.port) || !is_address(config.address))
      table.fail("listen", "is not ADDRESS:PORT, such as 127.0.0.1:7694");
  config.is_open_without_tls = table.boolean("open-without-tls").value_or(false);
  config.has_tls = table.boolean("tls").value_or(false);
  config.certificate_file = table.string("certificate").value_or("");
  config.certificate_key_file = table.string("certificate-key").value_or("");
  if (config.certificate_file.empty() != config.certificate_key_file.empty())
    table.fail("certificate", "needs certificate-key, and the other way round: name both files");
  if (!config.certificate_file.empty() && !config.has_tls)
    table.fail("certificate", "is for TLS only, write tls = true");
  if (config.has_tls && config.is_open_without_tls)
    table.fail("open-without-tls", "is true and so is tls, write one of them");
  if (!config.has_tls && !config.is_open_without_tls && !secure::is_loopback(config.address))
    table.fail("listen", "others can reach " + config.address +
                             " and could read the key on its way: write tls = true, or "
                             "open-without-tls = true where you trust the network");
  config.key_file = table.string("key").value_or("");
  if (!table.has("key")) table.fail_missing("key", "write key = \"hall.key\", a file");
}

void read_sessions(tool::TableReader& table, HallConfig& config, double machine_cores) {
  config.recordings_folder = table.string("recordings").value_or("");
  if (!table.has("recordings"))
    table.fail_missing("recordings", "write recordings = \"recordings\", a folder");
  config.state_folder = table.string("state").value_or("");
  auto& address = config.sessions_address;
  address = table.string("sessions-listen").value_or(address);
  if (address.starts_with('[') && address.ends_with(']'))
    address = address.substr(1, address.size() - 2);
  if (!is_address(address))
    table.fail("sessions-listen", "is no IPv4 or IPv6 address, such as 0.0.0.0");
  config.host = table.string("host").value_or("");
  read_ports(table, "ports", config.ports);
  read_ports(table, "figures-ports", config.figures_ports);
  config.most_sessions =
      static_cast<int>(table.integer("most-sessions", 1, kMostSessions).value_or(8));
  config.cores = table.number("cores", 0.1, kMostCores).value_or(machine_cores);
  config.restarts = static_cast<int>(table.integer("restarts", 0, 100).value_or(3));
  config.code_hours = table.number("code-hours", 0.01, 8760).value_or(12);
  if (config.ports.first <= config.figures_ports.last &&
      config.figures_ports.first <= config.ports.last)
    table.fail("figures-ports", "overlaps ports, choose two ranges");
  for (const auto* range : {&config.ports, &config.figures_ports})
    if (range->count() < config.most_sessions)
      table.fail("most-sessions",
                 fmt::format("is {}, and there are {} ports from {} on: widen the range",
                             config.most_sessions, range->count(), range->first));
}

}  // namespace

const Offer* HallConfig::find_offer(const std::string& name) const {
  const auto found = std::ranges::find(offers, name, &Offer::name);
  return found == offers.end() ? nullptr : &*found;
}

std::string HallConfig::list_offers() const {
  std::string all;
  for (const auto& offer : offers) all += (all.empty() ? "" : ", ") + offer.name;
  return all;
}

bool is_name(const std::string& text) {
  const auto is_plain = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'); };
  return !text.empty() && text.size() <= 32 && is_plain(text.front()) &&
         std::ranges::all_of(text, [&](char c) { return is_plain(c) || c == '-'; });
}

Result<HallConfig> read_hall_config_text(std::string_view text, const std::string& source,
                                         double machine_cores) {
  tool::Document document(source);
  const auto root =
      tool::parse_toml(document, text, source, kConfigLimitBytes, "configuration", kConfigExample);
  HallConfig config;
  if (root) {
    tool::TableReader table(document, *root, "");
    read_access(table, config);
    read_sessions(table, config, machine_cores);
    const auto offers = table.tables("offer");
    if (offers.size() > kMostOffers)
      table.fail("offer", fmt::format("there are {}, allowed are {}", offers.size(), kMostOffers));
    if (!table.has("offer"))
      table.fail_missing("offer", "write [[offer]] above each lesson or organ that may be started");
    table.finish();
    for (const auto* at : offers) {
      if (!document.ok()) break;
      auto offer = read_offer(document, *at);
      if (document.ok() && config.find_offer(offer.name) != nullptr)
        document.fail(at->source(), "offer.name", offer.name + " is there twice, choose another");
      config.offers.push_back(std::move(offer));
    }
  }
  if (!document.ok()) return document.error();
  return config;
}

Result<HallConfig> read_hall_config(const std::filesystem::path& file, double machine_cores) {
  const auto text = tool::read_text_file(file, kConfigLimitBytes, "configuration");
  if (!text) return text.error();
  return read_hall_config_text(*text, file.string(), machine_cores);
}

}  // namespace trocar::hall
