#include "common/command_line/command_line.h"

#include <memory>
#include <string>
#include <vector>

#include "common/base/nearest_word.h"
#include "common/base/printable.h"
#include "common/command_line/help_format.h"

namespace trocar::command_line {
namespace {

constexpr std::string_view kExamplesBegin = "Examples:\n";

// The lines of `examples` that begin with this command, each with the lines that explain it.
std::string examples_of(const std::string& examples, const std::string& command) {
  std::string found;
  bool is_of_it = false;
  for (std::size_t at = 0; at < examples.size();) {
    const auto end = std::min(examples.find('\n', at), examples.size());
    const auto line = examples.substr(at, end - at);
    at = end + 1;
    if (line.empty() || !line.starts_with("  ")) break;
    if (!line.starts_with("   ")) is_of_it = (line + " ").starts_with("  " + command + " ");
    if (is_of_it) found += line + "\n";
  }
  return found;
}

// Returns commands by name; one that has none is a group of options.
std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App* each) { return !each->get_name().empty(); });
}

std::vector<std::string> names_of(const std::vector<const CLI::App*>& commands) {
  std::vector<std::string> names;
  for (const auto* command : commands) names.push_back(command->get_name());
  return names;
}

// The command that the line names, else the program.
const CLI::App& chosen_in(const CLI::App& app) {
  for (const auto* command : commands_of(app))
    if (command->parsed()) return *command;
  return app;
}

void add_options_of(const CLI::App& app, std::vector<std::string>& names) {
  for (const auto* option :
       app.get_options([](const CLI::Option* o) { return o->nonpositional(); }))
    if (!option->get_group().empty())
      for (const auto& name : option->get_lnames()) names.push_back("--" + name);
  for (const auto* group :
       app.get_subcommands([](const CLI::App* each) { return each->get_name().empty(); }))
    add_options_of(*group, names);
}

std::string with_help(const CLI::App& app, const std::string& message) {
  const auto& chosen = chosen_in(app);
  const std::string command = &chosen == &app ? "" : " " + chosen.get_name();
  return message + " (see " + app.get_name() + command + " --help)";
}

// Says what of the line belongs to nothing, and what was probably meant.
std::string unknown_word(const CLI::App& app, const std::string& word) {
  const auto& chosen = chosen_in(app);
  const std::string program = app.get_name() + (&chosen == &app ? "" : " " + chosen.get_name());
  const auto shown = printable(word, 64);
  if (word.starts_with("-")) {
    std::vector<std::string> known;
    add_options_of(chosen, known);
    if (&chosen != &app) add_options_of(app, known);
    const auto name = word.substr(0, word.find('='));
    return shown + ": is no option of " + program + did_you_mean(name, known);
  }
  const auto commands = names_of(commands_of(app));
  if (&chosen != &app || commands.empty())
    return shown + ": is one word too many for " + program + ", take it out";
  std::string all;
  for (const auto& command : commands) all += (all.empty() ? "" : ", ") + command;
  const auto nearest = did_you_mean(word, commands);
  return shown + ": is no command of " + program +
         (nearest.empty() ? ", choose one of " + all : nearest);
}

// CLI11's words for what is missing or of the wrong form, as ours.
std::string said_plainly(const CLI::App& app, const std::string& message) {
  constexpr std::string_view kRequired = " is required", kConverted = "Could not convert: ";
  if (message == "A subcommand is required") {
    std::string all;
    for (const auto& name : names_of(commands_of(app))) all += (all.empty() ? "" : ", ") + name;
    return "a command is missing, choose one of " + all;
  }
  if (message.ends_with(kRequired))
    return message.substr(0, message.size() - kRequired.size()) + ": is missing, give it";
  const auto missing = message.find(": 1 required ");
  if (missing != std::string::npos && message.ends_with(" missing"))
    return message.substr(0, missing) + ": has no value, give one";
  const auto equals = message.find(" = ");
  if (message.starts_with(kConverted) && equals != std::string::npos)
    return message.substr(kConverted.size(), equals - kConverted.size()) + ": '" +
           message.substr(equals + 3) + "' is not a number of its kind, give one";
  return message;
}

}  // namespace

void prepare_help(CLI::App& app) {
  app.formatter(std::make_shared<HelpFormat>());
  const std::string footer = app.get_footer();
  const auto at = footer.find(kExamplesBegin);
  const auto examples = at == std::string::npos ? "" : footer.substr(at + kExamplesBegin.size());
  for (auto* command : app.get_subcommands([](CLI::App*) { return true; })) {
    command->formatter(app.get_formatter());
    const std::string said = command->get_footer();  // the program's, unless it has its own
    if (!said.empty() && said != footer) continue;
    const auto own = examples_of(examples, app.get_name() + " " + command->get_name());
    if (!own.empty()) command->footer(std::string(kExamplesBegin) + own);
  }
}

Result<bool> answer(const CLI::App& app, const CLI::ParseError& error) {
  if (error.get_exit_code() == 0) {
    app.exit(error);
    return false;
  }
  // A word that is required may be missing because it was misspelt.
  const bool may_be_misspelt = dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr ||
                               dynamic_cast<const CLI::RequiredError*>(&error) != nullptr;
  const auto words = app.remaining(true);
  return Error{ErrorCode::Usage,
               with_help(app, may_be_misspelt && !words.empty() ? unknown_word(app, words.front())
                                                                : said_plainly(app, error.what()))};
}

Result<bool> parse_command_line(CLI::App& app, int argc, char** argv) {
  prepare_help(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return answer(app, error);
  }
  return true;
}

}  // namespace trocar::command_line
