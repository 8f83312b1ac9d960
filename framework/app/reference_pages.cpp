// SPDX-License-Identifier: Apache-2.0
#include "framework/app/reference_pages.h"

#include <algorithm>
#include <string_view>

#include "framework/app/param_text.h"

namespace diorama {
namespace {

std::string upper(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](char c) { return c >= 'a' && c <= 'z' ? char(c - 32) : c; });
  return text;
}

/// Text inside of a Markdown table cell.
std::string cell(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '|') out += '\\';
    out += c == '\n' ? ' ' : c;
  }
  return out;
}

std::string code(const std::string& text) { return text.empty() ? "" : "`" + text + "`"; }

std::string markdown_table(const std::vector<ParamSpec>& specs) {
  if (specs.empty()) return "No parameters.\n";
  std::string text =
      "| key | type | default | range | unit | meaning |\n|---|---|---|---|---|---|\n";
  for (const ParamRow& row : param_rows(specs)) {
    text += "| " + code(cell(row.key)) + " | " + cell(row.type) + " | " +
            code(cell(row.default_value)) + " | " + cell(row.range) + " | " + cell(row.unit) +
            " | " + cell(row.help) + " |\n";
  }
  return text;
}

/// Text for roff: backslashes and hyphens as they are, no line that begins like a request.
std::string roff(std::string_view text) {
  std::string out;
  bool is_line_start = true;
  for (const char c : text) {
    if (is_line_start && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else {
      out += c;
    }
    is_line_start = c == '\n';
  }
  return out;
}

std::string man_head(const std::string& name, int section, const std::string& version,
                     const std::string& help) {
  return ".TH " + upper(name) + " " + std::to_string(section) + " \"\" \"diorama " + version +
         "\" \"Diorama\"\n.SH NAME\n" + roff(name) + " \\- " + roff(help) + "\n";
}

/// The first letter small and no full stop, as man pages have it.
std::string what_is(std::string text) {
  while (!text.empty() && text.back() == '.') text.pop_back();
  if (text.size() > 1 && text[0] >= 'A' && text[0] <= 'Z' && text[1] >= 'a') {
    text[0] = char(text[0] + 32);
  }
  return text;
}

std::string man_params(const std::vector<ParamSpec>& specs) {
  std::string text;
  for (const ParamRow& row : param_rows(specs)) {
    std::string facts = row.type;
    if (!row.range.empty()) facts += ", " + row.range;
    if (!row.unit.empty()) facts += ", in " + row.unit;
    if (!row.default_value.empty()) facts += ", default " + row.default_value;
    text += ".TP\n.B " + roff(row.key) + "\n" + roff(row.help) + " (" + roff(facts) + ")\n";
  }
  return text.empty() ? "None.\n" : text;
}

PageFile program_man(const std::vector<CommandPage>& commands, const std::string& version) {
  std::string text = man_head("diorama", 1, version, what_is(commands.front().help));
  text += ".SH SYNOPSIS\n.B diorama\n.RI [ options ]\n.I command\n.RI [ arguments ]\n";
  const auto add_options = [&text](const CommandPage& page) {
    for (const OptionPage& option : page.options) {
      text += ".TP\n.B " + roff(option.name) + "\n" + roff(option.help) + "\n";
    }
  };
  text += ".SH OPTIONS\n";
  add_options(commands.front());
  text += ".SH COMMANDS\n";
  for (std::size_t i = 1; i < commands.size(); ++i) {
    text += ".SS " + roff(commands[i].name) + "\n" + roff(commands[i].help) + ".\n";
    add_options(commands[i]);
  }
  text +=
      ".SH EXIT STATUS\n0 done; 1 a bug; 2 command line; 3 job file; 4 plugin; 5 asset; 6 output; "
      "130 interrupted.\n.SH ENVIRONMENT\n.TP\n.B DIORAMA_PLUGIN_PATH\nFolders with plugins, "
      "separated by colons.\n.TP\n.B DIORAMA_ASSETS_ROOT\nFolder below which asset paths are "
      "looked "
      "up.\n.SH SEE ALSO\n.BR diorama\\-job (5)\n";
  return {"man1/diorama.1", text};
}

PageFile program_markdown(const std::vector<CommandPage>& commands) {
  std::string text = "# Commands\n";
  for (const CommandPage& page : commands) {
    text += "\n## `" + page.name + "`\n\n" + page.help + "\n\n";
    if (page.options.empty()) continue;
    text += "| option | meaning |\n|---|---|\n";
    for (const OptionPage& option : page.options) {
      text += "| `" + cell(option.name) + "` | " + cell(option.help) + " |\n";
    }
  }
  return {"reference/commands.md", text};
}

std::string page_name(const DescribedComponent& component) {
  return std::string(kind_name(component.kind)) + "_" + component.type;
}

void add_component(const DescribedComponent& component, const std::string& version,
                   std::vector<PageFile>& files) {
  const std::string kind(kind_name(component.kind));
  files.push_back({"reference/" + page_name(component) + ".md",
                   "# " + kind + " `" + component.type + "`\n\n" + component.help + "\n\n" +
                       markdown_table(component.params)});
  const std::string name = "diorama-" + kind + "-" + component.type;
  files.push_back(
      {"man7/" + name + ".7", man_head(name, 7, version, what_is(component.help)) +
                                  ".SH PARAMETERS\n" + man_params(component.params) +
                                  ".SH SEE ALSO\n.BR diorama (1),\n.BR diorama\\-job (5)\n"});
}

PageFile index_of(const std::vector<DescribedComponent>& components) {
  std::string text = "# Reference\n\n- [Commands](commands.md)\n- [Job files](job.md)\n";
  std::string_view kind;
  for (const DescribedComponent& component : components) {
    const std::string_view now = kind_name(component.kind);
    if (now != kind) text += "\n## " + std::string(now) + "\n\n";
    kind = now;
    text +=
        "- [`" + component.type + "`](" + page_name(component) + ".md): " + component.help + "\n";
  }
  return {"reference/index.md", text};
}

}  // namespace

std::vector<PageFile> reference_pages(const std::vector<CommandPage>& commands,
                                      const std::vector<ParamSpec>& job,
                                      const std::vector<DescribedComponent>& components,
                                      const std::string& version) {
  std::vector<PageFile> files{program_man(commands, version), program_markdown(commands),
                              index_of(components)};
  files.push_back({"reference/job.md", "# Job files\n\n" + markdown_table(job)});
  files.push_back(
      {"man5/diorama-job.5",
       man_head("diorama-job", 5, version, "job files of diorama") +
           ".SH DESCRIPTION\nA YAML or JSON mapping. Entries that name a component with "
           "the key\n.B type\nalso take its parameters.\n.SH KEYS\n" +
           man_params(job) + ".SH SEE ALSO\n.BR diorama (1)\n"});
  for (const DescribedComponent& component : components) add_component(component, version, files);
  return files;
}

}  // namespace diorama
