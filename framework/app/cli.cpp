// SPDX-License-Identifier: Apache-2.0
#include "framework/app/cli.h"

#include <CLI/CLI.hpp>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <iostream>
#include <new>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

#include "diorama/config.h"
#include "framework/app/command_bench.h"
#include "framework/app/command_config.h"
#include "framework/app/command_convert.h"
#include "framework/app/command_diff.h"
#include "framework/app/command_docs.h"
#include "framework/app/command_doctor.h"
#include "framework/app/command_export.h"
#include "framework/app/command_inspect.h"
#include "framework/app/command_lint.h"
#include "framework/app/command_new_plugin.h"
#include "framework/app/command_plugins.h"
#include "framework/app/command_preview.h"
#include "framework/app/command_render.h"
#include "framework/app/command_replay.h"
#include "framework/app/command_run.h"
#include "framework/app/command_schema.h"
#include "framework/app/command_sensors.h"
#include "framework/app/command_stats.h"
#include "framework/app/command_status.h"
#include "framework/app/command_view.h"
#include "framework/app/exit_codes.h"
#include "framework/app/options.h"
#include "framework/app/standard_output.h"
#include "framework/config/clean_text.h"
#include "framework/host/console_log.h"
#include "framework/jobs/assemble.h"
#include "framework/output/workers.h"
#include "framework/plugins/fatal_end.h"
#include "framework/plugins/plugin_search.h"

namespace diorama {
namespace {

/// Everything that the command line can say. Options of one command do not share fields with those
/// of others, so what was not given keeps its default.
struct CommandLine {
  GlobalOptions global;
  std::string log_level = "info";
  std::string assets_root;
  RunCommandOptions run;
  std::string shard;
  std::string progress = "bar";
  PreviewOptions preview;
  StatusOptions status;
  std::filesystem::path finish;
  bool close_on_completion = false;
  JobOptions config;
  bool config_json = false;
  InspectOptions inspect;
  RenderOptions render;
  BenchOptions bench;
  SensorsOptions sensors;
  LintOptions lint;
  StatsOptions stats;
  ViewOptions view;
  bool no_browser = false;
  ReportOptions report;
  ConvertOptions convert;
  ReplayOptions replay;
  DiffOptions diff;
  ExportCommandOptions export_;
  NewPluginOptions new_plugin;
  bool plugins_json = false;
  bool describe_json = false;
  std::string describe_type;
  std::filesystem::path check_file;
  bool check_json = false;
  std::filesystem::path docs_folder = "diorama_reference";
  /// The command that was chosen.
  std::function<int(ConsoleLog&)> command;
};

void add_global_options(CLI::App& app, CommandLine& line) {
  app.set_version_flag("--version", "diorama " + program_version() + " (plugin ABI " +
                                        DIORAMA_DETAIL_TEXT(DIORAMA_SDK_ABI) + ")");
  app.add_option("--log-level", line.log_level, "Least level shown: debug, info, warning, error")
      ->type_name("LEVEL")
      ->capture_default_str();
  app.add_option("--threads", line.global.threads, "Threads to work with; 0: all of the machine")
      ->type_name("N")
      ->check(CLI::Range(0, 1024));
  app.add_option("--picture-mib", line.global.picture_mib,
                 "Memory that decoding one picture may take; what needs more is refused")
      ->type_name("N")
      ->check(CLI::Range(1, 1 << 20))
      ->capture_default_str();
  app.add_option("--asset-cache-mib", line.global.asset_cache_mib,
                 "Memory for loaded assets that are kept for later captures")
      ->type_name("N")
      ->check(CLI::Range(0, 1 << 20))
      ->capture_default_str();
  app.add_option("--plugin-dir", line.global.plugin_dirs,
                 "Folder with plugins, before all others (repeatable)")
      ->type_name("DIR")
      ->allow_extra_args(false);
  app.add_flag("--allow-unsafe-plugin-dir", line.global.allow_unsafe_plugin_dir,
               "Also load plugins that others than you may change");
  app.add_option("--assets-root", line.assets_root, "Folder below which asset paths are looked up")
      ->type_name("DIR");
}

/// The parser would take "-1" for 2^64 - 1.
CLI::Validator whole_number() {
  const auto check = [](const std::string& text) -> std::string {
    std::uint64_t value = 0;
    const char* end = text.data() + text.size();
    const auto [rest, failed] = std::from_chars(text.data(), end, value);
    if (failed == std::errc() && rest == end) return {};
    return "expected a whole number of 0 to 18446744073709551615, found '" + text + "'";
  };
  return CLI::Validator(check, "");
}

/// The job file may be given by its place or as --config FILE.
void add_job_options(CLI::App& command, JobOptions& job) {
  command
      .add_option("job,--config", job.job,
                  "Job file, YAML or JSON; without one, the defaults of the Infinigen tutorial")
      ->type_name("JOB");
  command
      .add_option("--set", job.sets,
                  "Change one value of the job, for instance renderer.samples=64 (repeatable)")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  command.add_option("--seed", job.seed, "Start of all random streams, instead of the job's")
      ->check(whole_number())
      ->type_name("N");
  command.add_option("--output", job.output, "Output folder, instead of the job's")
      ->type_name("DIR");
}

/// "2/5": the second of five parts.
void read_shard(const std::string& text, RunCommandOptions& run) {
  if (text.empty()) return;
  run.takes_visits = text == "auto";
  if (run.takes_visits) return;
  int shard = 0;
  int used = 0;
  if (std::sscanf(text.c_str(), "%8d/%8d%n", &shard, &run.shards, &used) != 2 ||
      std::size_t(used) != text.size() || shard < 1 || shard > run.shards) {
    throw Error(ErrorKind::Usage,
                "--shard: expected 'auto', or i/n with 1 <= i <= n, for instance 2/5, found '" +
                    text + "'");
  }
  run.shard = shard - 1;
}

void add_run(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("run", "Make the dataset that a job describes");
  add_job_options(*command, line.run.job);
  command
      ->add_option(
          "--queue-mib", line.run.queue_mib,
          "Memory for captures that wait to be written; a full queue holds up rendering. By "
          "default as much as threads and memory suggest, at least 256")
      ->check(CLI::Range(1, 1 << 20))
      ->type_name("N");
  command
      ->add_option(
          "--visits-in-flight", line.run.visits_in_flight,
          "Visits that are worked on at a time: while pictures of one are rendered, others "
          "are loaded and simulated; the files are the same for any number. By default as "
          "many as threads and memory suggest")
      ->check(CLI::Range(1, 1024))
      ->type_name("N");
  command->add_flag("--resume", line.run.resume, "Go on with the dataset in the output folder");
  command->add_flag("--overwrite", line.run.overwrite,
                    "Remove the dataset in the output folder first");
  command
      ->add_option("--shard", line.shard,
                   "Make one part of the dataset, 1/N to N/N; auto: visits that no other process "
                   "has, until there are none")
      ->type_name("I/N");
  command->add_flag("--verify", line.run.verify,
                    "With --resume: read all files first, make anew what is missing or damaged");
  command
      ->add_option("--lease-timeout", line.run.lease_timeout_s,
                   "Seconds without a sign of life after which a process of another machine counts "
                   "as dead")
      ->check(CLI::Range(5, 86400))
      ->type_name("N")
      ->capture_default_str();
  command
      ->add_option("--stopped-exit-code", line.run.stopped_exit_code,
                   "Exit code when a signal stopped the run, for schedulers that start it again")
      ->check(CLI::Range(0, 255))
      ->type_name("N")
      ->capture_default_str();
  command
      ->add_option("--progress", line.progress,
                   "How far the run is: bar (on stderr); json, openjd (lines on stdout)")
      ->check(CLI::IsMember({"bar", "json", "openjd"}))
      ->type_name("FORMAT")
      ->capture_default_str();
  command->add_flag("--dry-run", line.run.dry_run,
                    "Check and plan the job, try a visit of it in memory, and estimate time, disk "
                    "and memory; write nothing");
  command->add_flag("--plan", line.run.plan,
                    "Check and plan the job, without a look at its assets; write nothing");
  command->add_flag("--close-on-completion", line.close_on_completion,
                    "Accepted for scripts made for Isaac Sim; the program always ends");
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) {
      read_shard(line.shard, line.run);
      using Progress = RunCommandOptions::Progress;
      line.run.progress = line.progress == "json"     ? Progress::Json
                          : line.progress == "openjd" ? Progress::OpenJd
                                                      : Progress::Bar;
      return command_run(line.global, line.run, log);
    };
  });
}

void add_reader(CLI::App& command, std::string& reader) {
  command
      .add_option(
          "--reader", reader,
          "Reader to use: its type, or '{type: TYPE, KEY: VALUE}' with parameters; default: "
          "the one that knows the folder")
      ->type_name("TYPE");
}

void add_preview(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand(
      "preview", "Make a few of a job's pictures quickly, and estimate the whole job");
  add_job_options(*command, line.preview.job);
  command
      ->add_option("--capture", line.preview.captures,
                   "Number of a capture (repeatable); default: the first, the middle and the last")
      ->type_name("N")
      ->allow_extra_args(false);
  command
      ->add_option("--samples", line.preview.samples,
                   "Paths per pixel at most, for renderers that have them")
      ->check(CLI::Range(1, 1 << 20))
      ->type_name("N")
      ->capture_default_str();
  command->add_option("--dir", line.preview.folder, "Folder of the pictures")
      ->type_name("DIR")
      ->capture_default_str();
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) {
      return command_preview(line.global, line.preview, log);
    };
  });
}

void add_status(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("status", "Say how far a dataset is, and who works on it");
  command->add_option("dataset", line.status.dataset, "Folder of dataset.json")
      ->required()
      ->type_name("FOLDER");
  command->add_flag("--json", line.status.as_json, "As JSON");
  command->add_flag("--verify", line.status.verify,
                    "Read all files and say which are missing or not what was written");
  command->callback(
      [&line] { line.command = [&line](ConsoleLog&) { return command_status(line.status); }; });
}

void add_finish(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand(
      "finish", "Write what formats need at the end of a dataset whose captures are all there");
  command->add_option("dataset", line.finish, "Folder of dataset.json")
      ->required()
      ->type_name("FOLDER");
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) {
      return command_finish(line.global, line.finish, log);
    };
  });
}

void add_config(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      app.add_subcommand("config", "Print the job that a file means, with every default");
  add_job_options(*command, line.config);
  command->add_flag("--json", line.config_json, "As JSON instead of YAML");
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) {
      return command_config(line.global, line.config, line.config_json, log);
    };
  });
}

void add_plugins(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("plugins", "List plugins, describe and check them");
  command->require_subcommand(0, 1);
  command->add_flag("--json", line.plugins_json, "As JSON");
  command->callback([&line] {
    if (line.command) return;
    line.command = [&line](ConsoleLog& log) {
      return command_plugins_list(line.global, line.plugins_json, log);
    };
  });
  CLI::App* describe =
      command->add_subcommand("describe", "Parameters of a component: types, defaults, ranges");
  describe->add_option("type", line.describe_type, "Component, 'type' or 'kind/type'")
      ->required()
      ->type_name("TYPE");
  describe->add_flag("--json", line.describe_json, "As JSON");
  describe->callback([&line] {
    line.command = [&line](ConsoleLog& log) {
      return command_plugins_describe(line.global, line.describe_type,
                                      line.describe_json || line.plugins_json, log);
    };
  });
}

void add_plugins_check(CLI::App& app, CommandLine& line) {
  CLI::App* check = app.get_subcommand("plugins")->add_subcommand(
      "check", "Try what every plugin must hold, for one plugin file");
  check->add_option("file", line.check_file, "Plugin file")->required()->type_name("FILE");
  check->add_flag("--json", line.check_json, "As JSON");
  check->callback([&line] {
    line.command = [&line](ConsoleLog& log) {
      return command_plugins_check(line.check_file, line.check_json || line.plugins_json, log);
    };
  });
}

void add_inspect(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("inspect", "Say what a scene or model file holds");
  command->add_option("file", line.inspect.asset, "File, or scheme:rest such as dining_room:7")
      ->required()
      ->type_name("FILE");
  command->add_option("--depth", line.inspect.depth, "Levels of the tree to print; default: all")
      ->type_name("N");
  command->add_flag("--json", line.inspect.as_json, "As JSON");
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) {
      return command_inspect(line.global, line.inspect, log);
    };
  });
}

void add_picture_options(CLI::App& command, PictureOptions& options) {
  command
      .add_option("--camera", options.camera,
                  "Camera of the scene, by name; default: the first, else a view of all")
      ->type_name("NAME");
  command.add_option("--eye", options.eye, "Where a new camera stands, m")
      ->expected(3)
      ->type_name("N");
  command.add_option("--target", options.target, "What a new camera looks at, m")
      ->expected(3)
      ->type_name("N");
  command.add_option("--width", options.width, "Pixels; default: the camera's")
      ->check(CLI::Range(1, 16384))
      ->type_name("N");
  command.add_option("--height", options.height, "Pixels; default: by the camera's shape")
      ->check(CLI::Range(1, 16384))
      ->type_name("N");
  command.add_option("--renderer", options.renderer, "Renderer to use")
      ->type_name("TYPE")
      ->capture_default_str();
  command
      .add_option("--set", options.sets,
                  "Set a parameter of the renderer, for instance samples=256 (repeatable)")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  command.add_option("--seed", options.seed, "Pattern of the noise")
      ->check(whole_number())
      ->type_name("N");
}

void add_render(CLI::App& app, CommandLine& line) {
  RenderOptions& options = line.render;
  CLI::App* command = app.add_subcommand("render", "Render one picture of a scene or model file");
  command->add_option("file", options.picture.asset, "File, or scheme:rest such as dining_room:7")
      ->required()
      ->type_name("FILE");
  command
      ->add_option("-o,--picture", options.output,
                   "Picture to write; .png and .jpg as seen, .exr and .hdr in linear light")
      ->type_name("FILE")
      ->capture_default_str();
  add_picture_options(*command, options.picture);
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) {
      return command_render(line.global, line.render, log);
    };
  });
}

void add_bench(CLI::App& app, CommandLine& line) {
  BenchOptions& options = line.bench;
  CLI::App* command =
      app.add_subcommand("bench", "Render a scene; print speed, error and where the time goes");
  command
      ->add_option("--scene", options.picture.asset,
                   "File, or scheme:rest; default: a generated room")
      ->type_name("FILE");
  command
      ->add_option("--lights", options.lights,
                   "JSON file with lights and camera that replace the scene's")
      ->type_name("FILE");
  command->add_flag("--diffuse", options.is_diffuse,
                    "Make every material a matte surface of its base colour");
  command
      ->add_option("--reference", options.reference,
                   "Converged picture of the same size (.exr, .hdr) to compare with")
      ->type_name("FILE");
  command
      ->add_option("--reference-samples", options.reference_samples,
                   "Compare with a picture of our own with so many samples, not denoised")
      ->check(CLI::Range(1, 1 << 20))
      ->type_name("N");
  command->add_option("--repetitions", options.repetitions, "Pictures to render; medians count")
      ->check(CLI::Range(1, 1000))
      ->type_name("N")
      ->capture_default_str();
  command->add_option("-o,--picture", options.picture_file, "Where to put the last picture, .exr")
      ->type_name("FILE");
  command->add_flag("--json", options.as_json, "As JSON, with every repetition");
  add_picture_options(*command, options.picture);
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) { return command_bench(line.global, line.bench, log); };
  });
}

void add_sensors(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand(
      "sensors", "Make sensors' pictures from a stored dataset without rendering it again");
  command->add_option("dataset", line.sensors.dataset, "Output folder of a run")
      ->required()
      ->type_name("FOLDER");
  command
      ->add_option("--effects", line.sensors.effects,
                   "Job file, or one with the section `annotators` alone")
      ->required()
      ->type_name("FILE");
  command->add_option("-o,--output", line.sensors.output, "Output folder")
      ->type_name("DIR")
      ->capture_default_str();
  command->add_flag("--overwrite", line.sensors.overwrite,
                    "Remove the dataset in the output folder first");
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) {
      return command_sensors(line.global, line.sensors, log);
    };
  });
}

void add_lint(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      app.add_subcommand("lint", "Read a dataset back and check that its files agree");
  command->add_option("dataset", line.lint.dataset, "A writer's folder, or the output of a run")
      ->required()
      ->type_name("FOLDER");
  command->add_flag("--json", line.lint.as_json, "All findings as JSON");
  command->add_flag("--scenes", line.lint.looks_at_scenes,
                    "Also set up the scenes of a run anew and name what moves, hangs or is stuck");
  add_reader(*command, line.lint.reader);
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) { return command_lint(line.global, line.lint, log); };
  });
}

void add_stats(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      app.add_subcommand("stats", "Count what is in a dataset, and find pictures to look at");
  command->add_option("dataset", line.stats.dataset, "A dataset's folder, or the output of a run")
      ->required()
      ->type_name("FOLDER");
  CLI::Option* json = command->add_flag("--json", line.stats.as_json, "Everything as JSON");
  command->add_option("--html", line.stats.html, "Write a page of tables and pictures instead")
      ->type_name("FILE")
      ->excludes(json);
  add_reader(*command, line.stats.reader);
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) { return command_stats(line.global, line.stats, log); };
  });
}

void add_tolerance(CLI::App& command, double& tolerance) {
  command.add_option("--tolerance", tolerance, "How far pictures may be off in the mean, of 255")
      ->check(CLI::Range(0.0, 255.0))
      ->type_name("X")
      ->capture_default_str();
}

void add_view(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("view", "Show a dataset on a page in the browser");
  command->add_option("dataset", line.view.dataset, "A dataset's folder, or the output of a run")
      ->required()
      ->type_name("FOLDER");
  command->add_option("other", line.view.other, "Another one, to compare with it")
      ->type_name("FOLDER");
  add_tolerance(*command, line.view.tolerance);
  command->add_option("--port", line.view.port, "Port of this machine; 0: one that is free")
      ->check(CLI::Range(0, 65535))
      ->type_name("N")
      ->capture_default_str();
  command->add_flag("--no-browser", line.no_browser, "Print the address only");
  command
      ->add_option("--idle-minutes", line.view.idle_minutes,
                   "End when no page has asked for so long; 0: never")
      ->check(CLI::Range(0, 1 << 20))
      ->type_name("N")
      ->capture_default_str();
  add_reader(*command, line.view.reader);
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) {
      line.view.opens_browser = !line.no_browser;
      return command_view(line.global, line.view, log);
    };
  });
}

void add_report(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      app.add_subcommand("report", "Write the page of view as files that need no program");
  command->add_option("dataset", line.report.dataset, "A dataset's folder, or the output of a run")
      ->required()
      ->type_name("FOLDER");
  command->add_option("-o,--output", line.report.output, "Output folder")
      ->required()
      ->type_name("DIR");
  command
      ->add_option("--captures", line.report.captures,
                   "Show so many captures at most, spread over the dataset; counts are of all")
      ->check(CLI::Range(1, 1 << 20))
      ->type_name("N")
      ->capture_default_str();
  add_reader(*command, line.report.reader);
  command->add_flag("--all-overlays", line.report.has_all_overlays,
                    "Also depth, normals and flow, which make it several times as large");
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) {
      return command_report(line.global, line.report, log);
    };
  });
}

void add_conversion(CLI::App* command, CommandLine& line) {
  command
      ->add_option("--writer", line.convert.writers,
                   "Writer and its parameters: 'TYPE key=value ...' (repeatable)")
      ->required()
      ->type_name("WRITER")
      ->allow_extra_args(false);
  add_reader(*command, line.convert.reader);
  command->add_option("-o,--output", line.convert.output, "Output folder")
      ->required()
      ->type_name("DIR");
  command->add_flag("--overwrite", line.convert.overwrite,
                    "Remove the dataset in the output folder first");
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) {
      return command_convert(line.global, line.convert, log);
    };
  });
}

void add_convert(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("convert", "Write a dataset of any format in another one");
  command
      ->add_option("dataset", line.convert.datasets,
                   "A dataset's folder, or the output of a run that holds one")
      ->required()
      ->expected(1)
      ->type_name("FOLDER");
  add_conversion(command, line);
}

void add_merge(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand(
      "merge", "Make one dataset of several: captures numbered anew, classes united, splits kept");
  command
      ->add_option("datasets", line.convert.datasets,
                   "Datasets' folders, or outputs of runs that hold one each")
      ->required()
      ->expected(2, 1000)
      ->type_name("FOLDER");
  add_conversion(command, line);
}

void add_diff(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      app.add_subcommand("diff", "Say in what two datasets or runs differ; exit code as of diff");
  command->add_option("first", line.diff.first, "A dataset's folder, or the output of a run")
      ->required()
      ->type_name("FOLDER");
  command->add_option("second", line.diff.second, "Another one")->required()->type_name("FOLDER");
  add_tolerance(*command, line.diff.tolerance);
  add_reader(*command, line.diff.reader);
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) { return command_diff(line.global, line.diff, log); };
  });
}

void add_replay(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand(
      "replay", "Make captures of a run again from its own job, and compare their bytes");
  command->add_option("dataset", line.replay.dataset, "Output folder of a run")
      ->required()
      ->type_name("FOLDER");
  command->add_option("--capture", line.replay.captures, "Number of a capture (repeatable)")
      ->required()
      ->type_name("N")
      ->allow_extra_args(false);
  command
      ->add_option("--set", line.replay.sets,
                   "Set a key of the job, for instance renderer.samples=256 (repeatable)")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  command->add_option("-o,--output", line.replay.output, "Keep what is made in this folder")
      ->type_name("DIR");
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) {
      return command_replay(line.global, line.replay, log);
    };
  });
}

void add_verify(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand(
      "verify", "Make some captures of a run again, drawn by chance, and compare their bytes");
  command->add_option("dataset", line.replay.dataset, "Output folder of a run")
      ->required()
      ->type_name("FOLDER");
  command->add_option("--sample", line.replay.sample, "How many captures")
      ->check(CLI::Range(1, 1 << 20))
      ->type_name("N")
      ->capture_default_str();
  command->add_option("--seed", line.replay.seed, "Of the choice")
      ->check(whole_number())
      ->type_name("N");
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) {
      return command_replay(line.global, line.replay, log);
    };
  });
}

void add_new_plugin(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("new-plugin", "Write a plugin project to start from");
  command
      ->add_option("kind", line.new_plugin.kind,
                   "loader, physics, randomizer, renderer, annotator, writer or format")
      ->required()
      ->type_name("KIND");
  command
      ->add_option("name", line.new_plugin.name, "Name of plugin and component, such as my_boxes")
      ->required()
      ->type_name("NAME");
  command->add_option("--dir", line.new_plugin.dir, "Folder of the project; default: the name")
      ->type_name("DIR");
  command->add_option("--licence", line.new_plugin.licence, "Apache-2.0, BSD-3-Clause or MIT")
      ->type_name("LICENCE")
      ->capture_default_str();
  command->callback([&line] {
    line.command = [&line](ConsoleLog&) {
      return command_new_plugin(line.global, line.new_plugin);
    };
  });
}

void add_export(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("export", "Write a scene or model as USD, a sky as .hdr");
  command->add_option("asset", line.export_.asset, "File, or scheme:rest such as dining_room:7")
      ->required()
      ->type_name("ASSET");
  command->add_option("file", line.export_.file, "Ends in .usda (text), .usdc, .usd or .hdr")
      ->required()
      ->type_name("FILE");
  command->add_flag("--without-physics", line.export_.without_physics,
                    "Leave out masses, rigid bodies, colliders and joints");
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) {
      return command_export(line.global, line.export_, log);
    };
  });
}

void add_schema(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      app.add_subcommand("schema", "Print the JSON Schema of native jobs, for editors");
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) { return command_schema(line.global, log); };
  });
}

void add_doctor(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      app.add_subcommand("doctor", "Say what is here, what is missing and how to get it");
  command->callback([&line] {
    line.command = [&line](ConsoleLog& log) { return command_doctor(line.global, log); };
  });
}

/// Visible options in the order of the help.
std::vector<OptionPage> option_pages(const CLI::App& command) {
  std::vector<OptionPage> pages;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_group().empty()) continue;
    OptionPage page{option->get_name(false, true), option->get_description()};
    for (const std::string& flag : option->get_lnames()) page.flags.push_back("--" + flag);
    if (option->get_items_expected_max() > 0) page.value = option->get_type_name();
    if (!page.value.empty()) page.name += " " + page.value;
    page.is_argument = option->get_positional();
    pages.push_back(std::move(page));
  }
  return pages;
}

void add_pages(const CLI::App& command, const std::string& name, std::vector<CommandPage>& pages) {
  pages.push_back({name, command.get_description(), option_pages(command)});
  for (const CLI::App* below : command.get_subcommands([](const CLI::App*) { return true; })) {
    add_pages(*below, name + " " + below->get_name(), pages);
  }
}

void add_docs(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand(
      "docs", "Write the reference as Markdown and man pages, and completion for shells");
  command->add_option("--dir", line.docs_folder, "Output folder")
      ->type_name("DIR")
      ->capture_default_str();
  command->callback([&app, &line] {
    line.command = [&app, &line](ConsoleLog& log) {
      std::vector<CommandPage> pages;
      add_pages(app, "diorama", pages);
      return command_docs(line.global, pages, line.docs_folder, log);
    };
  });
}

void add_all(CLI::App& app, CommandLine& line) {
  app.require_subcommand(1);
  app.fallthrough();
  app.get_formatter()->column_width(34);
  add_global_options(app, line);
  add_run(app, line);
  add_preview(app, line);
  add_status(app, line);
  add_finish(app, line);
  add_config(app, line);
  add_plugins(app, line);
  add_plugins_check(app, line);
  add_inspect(app, line);
  add_render(app, line);
  add_bench(app, line);
  add_export(app, line);
  add_sensors(app, line);
  add_lint(app, line);
  add_stats(app, line);
  add_view(app, line);
  add_report(app, line);
  add_convert(app, line);
  add_merge(app, line);
  add_diff(app, line);
  add_replay(app, line);
  add_verify(app, line);
  add_new_plugin(app, line);
  add_schema(app, line);
  add_docs(app, line);
  add_doctor(app, line);
}

int run_command(CommandLine& line) {
  const LogLevel level = log_level_from(line.log_level);
  line.global.program = program_file();
  if (!line.assets_root.empty()) line.global.assets_root = line.assets_root;
  ConsoleLog log(level);
  line.global.log_level = level;
  const FatalEndReports reports;
  return line.command(log);
}

/// Of the commands that were given the last: "diorama plugins describe".
const CLI::App& given_command(const CLI::App& app, std::string& name) {
  const CLI::App* command = &app;
  name = app.get_name();
  while (!command->get_subcommands().empty()) {
    command = command->get_subcommands().front();
    name += " " + command->get_name();
  }
  return *command;
}

std::vector<std::string> option_names(const CLI::App& app, const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::App* source = &command; source != nullptr; source = source->get_parent()) {
    for (const CLI::Option* option : source->get_options()) {
      for (const std::string& flag : option->get_lnames()) names.push_back("--" + flag);
    }
    if (source == &app) break;
  }
  return names;
}

std::string not_known(const char* what, const std::string& name,
                      const std::vector<std::string>& names) {
  const std::string near = nearest_name(name, names);
  return std::string("unknown ") + what + " '" + name + "'" +
         (near.empty() ? "" : "; did you mean '" + near + "'?");
}

/// What is wrong with a command line, and which help to read.
std::string usage_message(const CLI::App& app, const CLI::ParseError& error) {
  std::string name;
  const CLI::App& command = given_command(app, name);
  const std::string advice = " (try " + name + " --help)";
  const bool may_have_more = error.get_exit_code() == int(CLI::ExitCodes::ExtrasError) ||
                             error.get_exit_code() == int(CLI::ExitCodes::RequiredError);
  const std::vector<std::string> rest = app.remaining(true);
  if (!may_have_more || rest.empty()) {
    const bool lacks_command = &command == &app;
    return (lacks_command && may_have_more ? "no command is given" : error.what()) + advice;
  }
  const std::string& first = rest.front();
  if (first.starts_with("-") && first.size() > 1) {
    return not_known("option", first.substr(0, first.find('=')), option_names(app, command)) +
           advice;
  }
  std::vector<std::string> commands;
  for (const CLI::App* below : command.get_subcommands([](const CLI::App*) { return true; })) {
    commands.push_back(below->get_name());
  }
  if (commands.empty()) return "nothing takes the argument '" + first + "'" + advice;
  return not_known("command", first, commands) + advice;
}

int parse_and_run(CLI::App& app, CommandLine& line, int argc, const char* const* argv) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() != 0) throw;
    // Help and version are no errors, they go to stdout.
    std::ostringstream text;
    app.exit(error, text);
    print_text(text.str());
    return 0;
  }
  return run_command(line);
}

int report(const std::string& message, int code) {
  std::cout.flush();
  std::fprintf(stderr, "error: %s\n", printable(message).c_str());
  return code;
}

}  // namespace

int exit_code(ErrorKind kind) { return int(kind) + 1; }

int run_program(int argc, const char* const* argv) {
  CommandLine line;
  CLI::App app(
      "Diorama fills 3-D rooms with labelled objects and writes image datasets with exact "
      "labels.",
      "diorama");
  try {
    StandardOutput output;
    add_all(app, line);
    const int code = parse_and_run(app, line, argc, argv);
    output.finish();
    return code;
  } catch (const CLI::ParseError& error) {
    return report(usage_message(app, error), exit_code(ErrorKind::Usage));
  } catch (const Error& error) {
    return report(error.what(), exit_code(error.kind()));
  } catch (const Busy& busy) {
    return report(busy.what(), kBusy);
  } catch (const std::bad_alloc&) {
    return report("out of memory", exit_code(ErrorKind::Internal));
  } catch (const std::exception& error) {
    return report(std::string("unexpected: ") + error.what(), exit_code(ErrorKind::Internal));
  }
}

}  // namespace diorama
