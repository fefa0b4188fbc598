#include "common/command_line/help_format.h"

#include <sstream>
#include <utility>

namespace trocar::command_line {
namespace {

// The kind of a value, where an option does not name it.
constexpr std::pair<std::string_view, std::string_view> kKinds[] = {
    {"UINT", "N"}, {"INT", "N"}, {"FLOAT", "X"}, {"TEXT", "TEXT"}};

// CLI11 has "KIND:LIMITS".
std::string value_text(const CLI::Option& option) {
  std::string text = option.get_type_name();
  for (const auto& [kind, shown] : kKinds)
    if (text == kind || text.starts_with(std::string(kind) + ":"))
      text.replace(0, kind.size(), shown);
  const auto colon = text.rfind(':');
  if (colon != std::string::npos && text.find(" to ", colon) != std::string::npos)
    text = text.substr(0, colon) + " (" + text.substr(colon + 1) + ")";
  return text.empty() ? text : " " + text;
}

}  // namespace

HelpFormat::HelpFormat() {
  label("Positionals", "Arguments");
  label("SUBCOMMAND", "COMMAND");
}

std::string HelpFormat::make_subcommands(const CLI::App* app, CLI::AppFormatMode) const {
  std::stringstream out;
  std::stringstream commands;
  for (const auto* each : app->get_subcommands({})) {
    if (!each->get_name().empty()) {
      commands << make_subcommand(each);
      continue;
    }
    out << make_group(each->get_group() + ", " + each->get_description(), false,
                      each->get_options([each](const CLI::Option* option) {
                        return option->nonpositional() && option != each->get_help_ptr();
                      }));
  }
  if (!commands.str().empty()) out << "\nCommands:\n" << commands.str();
  return out.str();
}

std::string HelpFormat::make_option_opts(const CLI::Option* option) const {
  std::string text;
  if (option->get_type_size() != 0 && option->nonpositional()) text = value_text(*option);
  if (option->get_expected_max() == CLI::detail::expected_max_vector_size) text += " ...";
  for (const auto* other : option->get_needs()) text += " (with " + other->get_name() + ")";
  return text;
}

std::string HelpFormat::make_option_desc(const CLI::Option* option) const {
  const auto& usual = option->get_default_str();
  const auto text = option->get_description();
  return usual.empty() ? text : text + " [" + usual + "]";
}

}  // namespace trocar::command_line
