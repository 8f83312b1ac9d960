// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/lint_dataset.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <map>
#include <sstream>

#include "diorama/error.h"
#include "framework/config/json_text.h"
#include "framework/lint/lint_formats.h"

namespace diorama {
namespace {

using lint::Dataset;

struct Format {
  const char* name;  ///< As the dataset's own page says it.
  void (*lint)(Dataset&);
};

constexpr std::array kFormats{Format{"BasicWriter", &lint::lint_basic},
                              Format{"PoseWriter", &lint::lint_pose},
                              Format{"DataVisualizationWriter", &lint::lint_visualization},
                              Format{"COCO", &lint::lint_coco},
                              Format{"YOLO", &lint::lint_yolo},
                              Format{"KITTI", &lint::lint_kitti},
                              Format{"Pascal VOC", &lint::lint_voc},
                              Format{"BOP", &lint::lint_bop},
                              Format{"WebDataset", &lint::lint_webdataset},
                              Format{"HDF5", &lint::lint_hdf5}};

std::string read_text(const std::filesystem::path& file) {
  std::error_code failed;
  if (!std::filesystem::is_regular_file(file, failed)) return {};
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return std::move(text).str();
}

/// Null when the folder is none of ours.
const Format* format_of(const std::filesystem::path& folder) {
  for (const auto& [page, key] : {std::pair{"metadata.txt", "name"}, {"dataset.json", "format"}}) {
    const auto json = parse_json_or_nothing(read_text(folder / page));
    if (!json.is_object() || !json.contains(key) || !json.at(key).is_string()) continue;
    const std::string name = json.at(key).get<std::string>();
    const auto found =
        std::ranges::find_if(kFormats, [&](const Format& format) { return format.name == name; });
    if (found != kFormats.end()) return &*found;
  }
  return nullptr;
}

LintReport lint_folder(const std::filesystem::path& folder, const Format& format) {
  LintReport report;
  report.dataset = folder.string();
  report.format = format.name;
  Dataset dataset(folder, report);
  // Readers tell their file where they can; what they do not expect must not end the others' work.
  dataset.reading(".", [&] { format.lint(dataset); });
  return report;
}

}  // namespace

std::vector<LintReport> lint_datasets(const std::filesystem::path& folder) {
  if (!std::filesystem::is_directory(folder)) {
    throw Error(ErrorKind::Usage, folder.string() + ": not a folder; give the output of a run");
  }
  std::vector<LintReport> reports;
  if (const Format* format = format_of(folder)) {
    reports.push_back(lint_folder(folder, *format));
    return reports;
  }
  std::vector<std::filesystem::path> below;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.is_directory()) below.push_back(entry.path());
  }
  std::ranges::sort(below);
  for (const auto& path : below) {
    if (const Format* format = format_of(path)) reports.push_back(lint_folder(path, *format));
  }
  if (reports.empty()) {
    throw Error(ErrorKind::Usage,
                folder.string() +
                    ": holds no dataset (no metadata.txt or dataset.json of a known "
                    "format, nor do its folders)");
  }
  return reports;
}

std::string lint_text(const LintReport& report, std::size_t most) {
  std::string text = report.dataset + ": " + report.format + ", " + std::to_string(report.files) +
                     " files, " + std::to_string(report.checks) + " checks, " +
                     (report.findings.empty() ? "nothing found"
                                              : std::to_string(report.findings.size()) + " found") +
                     "\n";
  std::map<std::string, std::size_t> shown;
  for (const LintFinding& finding : report.findings) {
    if (++shown[finding.check] > most) continue;
    text += "  " + finding.check + ": " + finding.file + ": " + finding.message + "\n";
  }
  for (const auto& [check, count] : shown) {
    if (count > most) text += "  " + check + ": " + std::to_string(count - most) + " more\n";
  }
  return text;
}

std::string lint_json(const std::vector<LintReport>& reports) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const LintReport& report : reports) {
    nlohmann::ordered_json findings = nlohmann::ordered_json::array();
    for (const LintFinding& finding : report.findings) {
      findings.push_back(
          {{"check", finding.check}, {"file", finding.file}, {"message", finding.message}});
    }
    list.push_back({{"dataset", report.dataset},
                    {"format", report.format},
                    {"files", report.files},
                    {"checks", report.checks},
                    {"findings", std::move(findings)}});
  }
  return list.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace diorama
