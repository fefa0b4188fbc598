#include "server/app/config/config_file.h"

#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <optional>

#include "common/base/printable.h"
#include "common/command_line/command_line.h"
#include "common/tool/toml_reader.h"

namespace trocar::app {
namespace {

constexpr std::size_t kMostBytes = 1u << 20;

// CLI11 asks this when it meets --config. It refuses unknown keys, values of the wrong kind and
// those that `check` refuses, each with file, line and key.
class ConfigReader : public CLI::ConfigTOML {
 public:
  // `app` and `origins` outlive this. `example`: a file that errors point at.
  ConfigReader(const CLI::App& app, CheckOption check, OptionOrigins& origins, const char* example)
      : app_(app), check_(std::move(check)), origins_(origins), example_(example) {}

  // Throws CLI::ConfigError, as CLI11 wants it.
  std::vector<CLI::ConfigItem> from_config(std::istream& input) const override;

 private:
  Result<std::vector<CLI::ConfigItem>> read(const std::string& text, const std::string& file) const;

  const CLI::App& app_;
  const CheckOption check_;
  OptionOrigins& origins_;
  const char* const example_;
};

// The value as one would type it; nothing if it has no such form.
std::optional<std::string> typed(const toml::node& node) {
  if (const auto* text = node.as_string()) return text->get();
  if (const auto* number = node.as_integer()) return std::to_string(number->get());
  if (const auto* truth = node.as_boolean()) return truth->get() ? "true" : "false";
  const auto* number = node.as_floating_point();
  if (number == nullptr || !std::isfinite(number->get())) return std::nullopt;
  return fmt::format("{}", number->get());
}

bool is_flag(const CLI::Option& option) {
  return option.get_expected_min() == 0;
}

// Reads one key; `document` has the error.
std::string read_key(const CLI::App& app, const CheckOption& check, const std::string& key,
                     const toml::node& node, tool::Document& document) {
  const auto fail = [&](const std::string& what) {
    document.fail(node.source(), printable(key, 64), what);
    return std::string();
  };
  const auto* option = app.get_option_no_throw("--" + key);
  if (option == nullptr)
    return fail("is unknown, the keys are the options of --help without their dashes");
  if (!option->get_configurable()) return fail("belongs on the command line, take it out");
  if (is_flag(*option) && !node.is_boolean())
    return fail("is not true or false, write one of them");
  auto text = typed(node);
  if (!text || (node.is_boolean() && !is_flag(*option)))
    return fail("is neither a text in quotes nor a plain number, write one of them");
  if (text->empty()) return fail("is empty, give it a value or take the line out");
  if (const auto checked = check(key, *text); !checked) return fail(checked.error().message);
  return *text;
}

std::vector<CLI::ConfigItem> ConfigReader::from_config(std::istream& input) const {
  const auto file = app_.get_config_ptr()->as<std::string>();
  std::string text(kMostBytes + 1, '\0');
  input.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(input.gcount()));
  auto found = read(text, file);
  if (!found) throw CLI::ConfigError(found.error().message);
  return std::move(*found);
}

Result<std::vector<CLI::ConfigItem>> ConfigReader::read(const std::string& text,
                                                        const std::string& file) const {
  tool::Document document(file);
  const auto table = tool::parse_toml(document, text, file, kMostBytes, "configuration", example_);
  std::vector<CLI::ConfigItem> values;
  origins_.read_from(file);
  if (table)
    for (const auto& [name, node] : *table) {
      const std::string key(name.str());
      auto value = read_key(app_, check_, key, node, document);
      if (!document.ok()) break;
      if (!app_.get_option("--" + key)->empty()) continue;  // the command line wins
      origins_.add(key, static_cast<int>(node.source().begin.line));
      values.push_back({.parents = {}, .name = key, .inputs = {std::move(value)}});
    }
  if (!document.ok()) return document.error();
  return values;
}

}  // namespace

void add_config_options(CLI::App& app, bool& checks_config, const std::string& checks) {
  auto* config = app.set_config("--config", "",
                                "options from this file (TOML), each without its dashes; the "
                                "command line wins")
                     ->type_name("FILE");
  app.add_flag("--check-config", checks_config,
               "check all " + checks + " as a start would, and exit with 0 or 2")
      ->needs(config)
      ->configurable(false);
}

Status check_option(CLI::App& app, const std::string& key, const std::string& text,
                    const std::function<Status()>& finish) {
  const auto refused = [&key](const std::string& message) {
    for (const auto& name : {"--" + key + ": ", key + ": "})
      if (message.starts_with(name)) return Error{ErrorCode::Usage, message.substr(name.size())};
    return Error{ErrorCode::Usage, message};
  };
  auto* option = app.get_option("--" + key);
  try {
    option->add_result(text);
    option->run_callback();
  } catch (const CLI::ParseError& error) {
    return refused(error.what());
  }
  const auto finished = finish();
  return finished ? finished : refused(finished.error().message);
}

Result<bool> parse_with_config(CLI::App& app, int argc, char** argv, CheckOption check,
                               OptionOrigins& origins, const char* example) {
  command_line::prepare_help(app);
  app.config_formatter(std::make_shared<ConfigReader>(app, std::move(check), origins, example));
  const auto usage = [&origins](const std::string& message) {
    return Error{ErrorCode::Usage, origins.placed(message)};
  };
  try {
    app.parse(argc, argv);
  } catch (const CLI::FileError& error) {
    return usage("--config: " + std::string(error.what()) + ", name a file that is there");
  } catch (const CLI::ConfigError& error) {
    return usage(error.what());
  } catch (const CLI::ParseError& error) {
    const auto answered = command_line::answer(app, error);
    return answered ? answered : usage(answered.error().message);
  }
  return true;
}

std::string config_file_of(const CLI::App& app) {
  const auto* option = app.get_config_ptr();
  return option->count() > 0 ? option->as<std::string>() : std::string();
}

}  // namespace trocar::app
