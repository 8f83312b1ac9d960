// SPDX-License-Identifier: Apache-2.0
#include "framework/app/completion_scripts.h"

#include <array>
#include <map>
#include <string_view>

#include "framework/app/shell_text.h"
#include "framework/config/joined.h"

namespace diorama {
namespace {

/// What a shell offers where a value is due.
enum class Offer { Nothing, Files, Folders, Types, Words };

struct ValueOffer {
  std::string_view value;  ///< As the help names it.
  Offer offer;
  const char* words = "";
};
constexpr std::array kValueOffers{
    ValueOffer{"DIR", Offer::Folders},
    ValueOffer{"I/N", Offer::Nothing},
    ValueOffer{"KEY=VALUE", Offer::Nothing},
    ValueOffer{"KIND", Offer::Words, "loader physics randomizer renderer annotator writer format"},
    ValueOffer{"LEVEL", Offer::Words, "debug info warning error"},
    ValueOffer{"LICENCE", Offer::Words, "Apache-2.0 BSD-3-Clause MIT"},
    ValueOffer{"N", Offer::Nothing},
    ValueOffer{"NAME", Offer::Nothing},
    ValueOffer{"TYPE", Offer::Types}};

constexpr const char* kHead =
    " Written by `diorama docs` from the program's own commands and options.\n";
/// Lists the component types of the plugins that are there.
constexpr const char* kListTypes =
    R"(diorama plugins 2>/dev/null | sed -n "s/^  \([A-Za-z0-9_]*\)  .*/\1/p")";

/// `value` is as the help has it: "N", or "N:INT in [0 - 9]" with the values that are checked.
ValueOffer offer_for(std::string_view value) {
  value = value.substr(0, value.find(':'));
  for (const ValueOffer& known : kValueOffers) {
    if (known.value == value) return known;
  }
  return {value, Offer::Files};  // JOB, FILE, ASSET ...
}

std::string last_word(const std::string& name) { return name.substr(name.rfind(' ') + 1); }

bool is_below(const CommandPage& command, const CommandPage& parent) {
  return command.name.substr(0, command.name.rfind(' ')) == parent.name &&
         command.name != parent.name;
}

std::vector<const CommandPage*> commands_below(const CommandPage& parent,
                                               const std::vector<CommandPage>& commands) {
  std::vector<const CommandPage*> below;
  for (const CommandPage& command : commands) {
    if (is_below(command, parent)) below.push_back(&command);
  }
  return below;
}

/// Branches of a `case` with the same body under one pattern, in order of their bodies.
class CaseBranches {
 public:
  void add(const std::string& body, const std::string& pattern) {
    patterns_[body].push_back(pattern);
  }
  std::string text(const char* open) const {
    std::string text;
    for (const auto& [body, patterns] : patterns_) {
      text += std::string("    ") + open + joined(patterns, " | ") + ") " + body + " ;;\n";
    }
    return text;
  }

 private:
  std::map<std::string, std::vector<std::string>> patterns_;
};

/// How bash or zsh says what a value may be.
using ValueCode = std::string (*)(const ValueOffer&);

/// bash and zsh read the command line alike; they differ in the words for what is offered.
struct ShellDialect {
  const char* open_pattern;
  ValueCode value;
};

std::string known_commands(const std::vector<CommandPage>& commands, const ShellDialect& shell) {
  CaseBranches branches;
  for (std::size_t i = 1; i < commands.size(); ++i) {
    branches.add("at+=\" $word\"", shell_quoted(commands[i].name));
  }
  return branches.text(shell.open_pattern);
}

/// What may follow an option that takes a value. Options of the program go with every command.
std::string values_of_options(const std::vector<CommandPage>& commands, const ShellDialect& shell) {
  CaseBranches branches;
  for (const CommandPage& command : commands) {
    const bool is_program = &command == &commands.front();
    for (const OptionPage& option : command.options) {
      if (option.value.empty()) continue;
      std::string body = shell.value(offer_for(option.value));
      body += body.empty() ? "return" : "; return";
      for (const std::string& flag : option.flags) {
        branches.add(body, is_program ? "*" + shell_quoted(" " + flag)
                                      : shell_quoted(command.name + " " + flag));
      }
    }
  }
  return branches.text(shell.open_pattern);
}

std::string values_of_arguments(const std::vector<CommandPage>& commands,
                                const ShellDialect& shell) {
  CaseBranches branches;
  for (const CommandPage& command : commands) {
    for (const OptionPage& option : command.options) {
      if (!option.is_argument) continue;
      const std::string body = shell.value(offer_for(option.value));
      if (!body.empty()) branches.add(body, shell_quoted(command.name));
    }
  }
  return branches.text(shell.open_pattern);
}

std::string bash_reply(const std::string& generator) {
  return "mapfile -t -O ${#COMPREPLY[@]} COMPREPLY < <(compgen " + generator + " -- \"$current\")";
}

std::string bash_value(const ValueOffer& value) {
  switch (value.offer) {
    case Offer::Nothing:
      return "";
    case Offer::Files:
      return bash_reply("-f");
    case Offer::Folders:
      return bash_reply("-d");
    case Offer::Types:
      return bash_reply("-W \"$(" + std::string(kListTypes) + ")\"");
    case Offer::Words:
      return bash_reply("-W " + shell_quoted(value.words));
  }
  return "";
}

std::string flags_of(const CommandPage& command) {
  std::vector<std::string> flags;
  for (const OptionPage& option : command.options) {
    flags.insert(flags.end(), option.flags.begin(), option.flags.end());
  }
  return joined(flags, " ");
}

std::string bash_script(const std::vector<CommandPage>& commands) {
  const ShellDialect bash{"", bash_value};
  std::string words;
  for (const CommandPage& command : commands) {
    std::vector<std::string> below;
    for (const CommandPage* one : commands_below(command, commands)) {
      below.push_back(last_word(one->name));
    }
    const bool is_program = &command == &commands.front();
    words += "    " + shell_quoted(command.name) + ")";
    if (!below.empty()) words += " commands=" + shell_quoted(joined(below, " "));
    if (!is_program) words += " options+=" + shell_quoted(" " + flags_of(command));
    words += " ;;\n";
  }
  return "# SPDX-License-Identifier: Apache-2.0\n# Completion for bash." + std::string(kHead) +
         "_diorama() {\n"
         "  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]}\n"
         "  local at=diorama word commands= options=" +
         shell_quoted(flags_of(commands.front())) +
         "\n  COMPREPLY=()\n"
         "  for word in \"${COMP_WORDS[@]:1:COMP_CWORD-1}\"; do\n"
         "    case \"$at $word\" in\n" +
         known_commands(commands, bash) +
         "    esac\n  done\n"
         "  case \"$at $previous\" in\n" +
         values_of_options(commands, bash) + "  esac\n  case $at in\n" + words +
         "  esac\n"
         "  if [[ $current == -* ]]; then\n    " +
         bash_reply("-W \"$options\"") + "\n    return\n  fi\n  " + bash_reply("-W \"$commands\"") +
         "\n  case $at in\n" + values_of_arguments(commands, bash) +
         "  esac\n}\ncomplete -o filenames -F _diorama diorama\n";
}

std::string zsh_value(const ValueOffer& value) {
  switch (value.offer) {
    case Offer::Nothing:
      return "";
    case Offer::Files:
      return "_files";
    case Offer::Folders:
      return "_files -/";
    case Offer::Types:
      return "compadd -- ${(f)\"$(" + std::string(kListTypes) + ")\"}";
    case Offer::Words:
      return std::string("compadd -- ") + value.words;
  }
  return "";
}

/// Elements of an array for _describe.
std::string zsh_options(const CommandPage& command) {
  std::vector<std::string> lines;
  for (const OptionPage& option : command.options) {
    for (const std::string& flag : option.flags)
      lines.push_back(shell_quoted(flag + ":" + option.help));
  }
  return joined(lines, " ");
}

std::string zsh_script(const std::vector<CommandPage>& commands) {
  const ShellDialect zsh{"(", zsh_value};
  std::string words;
  for (const CommandPage& command : commands) {
    std::vector<std::string> below;
    for (const CommandPage* one : commands_below(command, commands)) {
      below.push_back(shell_quoted(last_word(one->name) + ":" + one->help));
    }
    const bool is_program = &command == &commands.front();
    words += "  (" + shell_quoted(command.name) + ") commands=(" + joined(below, " ") + ")";
    if (!is_program) words += "; options+=(" + zsh_options(command) + ")";
    words += " ;;\n";
  }
  return "#compdef diorama\n# SPDX-License-Identifier: Apache-2.0\n# Completion for zsh." +
         std::string(kHead) +
         "local at=diorama word\nlocal -a options commands\n"
         "for word in ${words[2,CURRENT-1]}; do\n"
         "  case \"$at $word\" in\n" +
         known_commands(commands, zsh) +
         "  esac\ndone\n"
         "case \"$at ${words[CURRENT-1]}\" in\n" +
         values_of_options(commands, zsh) + "esac\noptions=(" + zsh_options(commands.front()) +
         ")\ncase $at in\n" + words +
         "esac\n"
         "if [[ $PREFIX == -* ]]; then\n  _describe -o option options\n  return\nfi\n"
         "(( $#commands )) && _describe command commands\n"
         "case $at in\n" +
         values_of_arguments(commands, zsh) + "esac\n";
}

std::string fish_value(const ValueOffer& value) {
  switch (value.offer) {
    case Offer::Nothing:
      return " -x";
    case Offer::Files:
      return " -r -F";
    case Offer::Folders:
      return " -x -a '(__fish_complete_directories)'";
    case Offer::Types:
      return " -x -a " + shell_quoted("(" + std::string(kListTypes) + ")");
    case Offer::Words:
      return " -x -a " + shell_quoted(value.words);
  }
  return "";
}

std::string fish_command(const CommandPage& command, const std::vector<CommandPage>& commands) {
  const std::string where = " -n \"__diorama_is_at '" + command.name + "'\"";
  const bool is_program = &command == &commands.front();
  std::string text;
  for (const CommandPage* below : commands_below(command, commands)) {
    text += "complete -c diorama" + where + " -a " + last_word(below->name) + " -d " +
            shell_quoted(below->help) + "\n";
  }
  for (const OptionPage& option : command.options) {
    const std::string value = option.value.empty() ? "" : fish_value(offer_for(option.value));
    for (const std::string& flag : option.flags) {
      text += "complete -c diorama" + (is_program ? "" : where) + " -l " + flag.substr(2) + value +
              " -d " + shell_quoted(option.help) + "\n";
    }
    if (option.is_argument && offer_for(option.value).offer != Offer::Nothing) {
      text += "complete -c diorama" + where + value + "\n";
    }
  }
  return text;
}

std::string fish_script(const std::vector<CommandPage>& commands) {
  std::vector<std::string> names;
  for (std::size_t i = 1; i < commands.size(); ++i) names.push_back(shell_quoted(commands[i].name));
  std::string text = "# SPDX-License-Identifier: Apache-2.0\n# Completion for fish." +
                     std::string(kHead) +
                     "function __diorama_is_at\n"
                     "    set -l at diorama\n"
                     "    for word in (commandline -opc)\n"
                     "        switch \"$at $word\"\n"
                     "            case " +
                     joined(names, " ") +
                     "\n                set at \"$at $word\"\n"
                     "        end\n    end\n"
                     "    test \"$at\" = \"$argv[1]\"\nend\n"
                     "complete -c diorama -f\n";
  for (const CommandPage& command : commands) text += fish_command(command, commands);
  return text;
}

}  // namespace

std::vector<PageFile> completion_scripts(const std::vector<CommandPage>& commands) {
  return {{"completion/diorama.bash", bash_script(commands)},
          {"completion/_diorama", zsh_script(commands)},
          {"completion/diorama.fish", fish_script(commands)}};
}

}  // namespace diorama
