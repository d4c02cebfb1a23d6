// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/program_options.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"

namespace tissueform {
namespace {

constexpr int kWrongUse = 2;
constexpr char kHidden[] = "HIDDEN";

std::string Environment(const std::string& variable) {
  const char* value = std::getenv(variable.c_str());
  return value == nullptr ? "" : value;
}

std::string VariableOf(const std::string& prefix, const std::string& name) {
  return prefix + absl::AsciiStrToUpper(absl::StrReplaceAll(name, {{"-", "_"}}));
}

bool IsFlag(const CLI::Option& option) { return option.get_expected_max() == 0; }

bool IsNo(const std::string& value) {
  const std::string lower = absl::AsciiStrToLower(value);
  return lower == "false" || lower == "off" || lower == "no" || lower == "0";
}

// `message` where the name may be a typing mistake; the text of a file that was meant for something
// else, a token or a key, is not repeated.
std::string WrongName(const std::string& name, const std::string& message) {
  constexpr size_t kLongestName = 40;
  const bool may_be_a_name =
      name.size() <= kLongestName && std::all_of(name.begin(), name.end(), [](unsigned char c) {
        return absl::ascii_islower(c) || absl::ascii_isdigit(c) || c == '-' || c == '_';
      });
  return may_be_a_name ? message : "it is not a file of options: lines are `name = value`";
}

// CLI11's own reader of files, which lets a file win over the environment, passes over what it does
// not know, and counts `flag = false` as a flag that was given.
class ConfigFile final : public CLI::ConfigBase {
 public:
  ConfigFile(const CLI::App* app, std::string prefix) : app_(app), prefix_(std::move(prefix)) {}

  std::vector<CLI::ConfigItem> from_config(std::istream& input) const override {
    std::vector<CLI::ConfigItem> kept;
    for (CLI::ConfigItem& item : CLI::ConfigBase::from_config(input)) {
      if (!Counts(item)) continue;
      const auto same = std::find_if(kept.begin(), kept.end(), [&item](const auto& earlier) {
        return earlier.name == item.name;
      });
      if (same == kept.end()) {
        kept.push_back(std::move(item));
      } else {
        same->inputs.insert(same->inputs.end(), item.inputs.begin(), item.inputs.end());
      }
    }
    return kept;
  }

 private:
  bool Counts(const CLI::ConfigItem& item) const {
    if (!item.parents.empty()) {
      const std::string& section = item.parents.front();
      throw CLI::ConfigError(WrongName(
          section, absl::StrCat("section [", section, "]: sections are not supported; remove it")));
    }
    const CLI::Option* option = app_->get_option_no_throw("--" + item.name);
    if (option == nullptr || !option->get_configurable()) {
      throw CLI::ConfigError(
          WrongName(item.name, absl::StrCat("there is no option \"", item.name, "\"")));
    }
    if (!Environment(VariableOf(prefix_, item.name)).empty()) return false;
    return !(IsFlag(*option) && item.inputs.size() == 1 && IsNo(item.inputs.front()));
  }

  const CLI::App* const app_;
  const std::string prefix_;
};

// Without the parts of an address that may be secret.
std::string Hide(const std::string& value) {
  const size_t scheme = value.find("://");
  if (scheme == std::string::npos) return value;
  std::string shown = value.substr(0, value.find('?'));
  if (shown.size() < value.size()) absl::StrAppend(&shown, "?", kHidden);
  const size_t host = scheme + 3;
  const size_t at = shown.substr(0, shown.find('/', host)).rfind('@');
  return at == std::string::npos || at < host ? shown : shown.replace(host, at - host, kHidden);
}

// As CLI11 reads it: it knows quotes, but no escapes, and '#' begins a comment within quotes too.
std::optional<std::string> Quoted(const std::string& value) {
  const bool plain = !value.empty() && std::all_of(value.begin(), value.end(), [](unsigned char c) {
    return absl::ascii_isalnum(c) || absl::StrContains("_-+./:%@?=", static_cast<char>(c));
  });
  if (plain) return value;
  if (value.find_first_of("#\n\r`") != std::string::npos) return std::nullopt;
  for (const char quote : {'"', '\''}) {
    if (value.find(quote) == std::string::npos)
      return absl::StrCat(std::string(1, quote), value, std::string(1, quote));
  }
  return std::nullopt;
}

std::string Line(const CLI::Option& option) {
  const std::string& name = option.get_single_name();
  std::vector<std::string> values = option.results();
  if (IsFlag(option))
    return absl::StrCat(name, " = ", option.count() > 0 && !IsNo(values.back()) ? "true" : "false",
                        "\n");
  if (values.empty()) {
    if (option.get_default_str().empty()) return absl::StrCat("# ", name, " is not set\n");
    // Where it is given, others must or must not be: its default goes without saying.
    if (!option.get_needs().empty() || !option.get_excludes().empty()) {
      return absl::StrCat("# ", name, " = ", option.get_default_str(), "\n");
    }
    values = {option.get_default_str()};
  }
  std::vector<std::string> quoted;
  for (const std::string& value : values) {
    const std::optional<std::string> text = Quoted(Hide(value));
    if (!text.has_value()) {
      return absl::StrCat("# ", name,
                          " has a character that a file cannot hold: set it on the command line\n");
    }
    quoted.push_back(*text);
  }
  const std::string list = absl::StrJoin(quoted, ", ");
  return absl::StrCat(name, " = ", quoted.size() == 1 ? list : absl::StrCat("[", list, "]"), "\n");
}

std::string OneLine(const std::string& text) {
  return absl::StrReplaceAll(text, {{"\r", " "}, {"\n", " "}});
}

}  // namespace

void AddConfiguration(CLI::App& app, const std::string& environment_prefix) {
  for (CLI::Option* option : app.get_options()) {
    const std::string variable = VariableOf(environment_prefix, option->get_single_name());
    // For CLI11 a flag is given when its variable says no.
    if (!option->get_configurable() || (IsFlag(*option) && IsNo(Environment(variable)))) continue;
    option->envname(variable);
  }
  const std::string variable = VariableOf(environment_prefix, "config");
  const std::string file = Environment(variable);
  app.set_config("--config", file,
                 absl::StrCat("file with options, as `name = value` lines (Env:", variable, ")"),
                 !file.empty())
      ->type_name("FILE")
      ->configurable(false);
  app.config_formatter(std::make_shared<ConfigFile>(&app, environment_prefix));
  const std::string help = "print all options with their values, in the form of --config, and exit";
  app.add_flag("--print-config", help)->configurable(false);
}

void AddRemovedOption(CLI::App& app, const std::string& name, const std::string& instead) {
  app.add_option_function<std::string>(name,
                                       [name, instead](const std::string& /*value*/) {
                                         throw CLI::ValidationError(name, "removed; " + instead);
                                       })
      ->expected(0, 1)
      ->group("");
}

std::optional<int> ParseProgramOptions(CLI::App& app, int argc, const char* const* argv) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp& help) {
    return app.exit(help);
  } catch (const CLI::ConfigError& error) {
    const std::vector<std::string> given = app.get_config_ptr()->results();
    const std::string file = given.empty() ? app.get_config_ptr()->get_default_str() : given.back();
    std::fprintf(stderr, "%s: %s: %s; see --help\n", app.get_name().c_str(), file.c_str(),
                 OneLine(error.what()).c_str());
    return kWrongUse;
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "%s: %s; see --help\n", app.get_name().c_str(),
                 OneLine(error.what()).c_str());
    return kWrongUse;
  }
  if (app.count("--print-config") == 0) return std::nullopt;
  std::fputs(PrintedConfiguration(app).c_str(), stdout);
  return std::fflush(stdout) == 0 ? 0 : 1;
}

std::string PrintedConfiguration(const CLI::App& app) {
  std::string text;
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_configurable() && !option->get_group().empty()) text += Line(*option);
  }
  return text;
}

}  // namespace tissueform
