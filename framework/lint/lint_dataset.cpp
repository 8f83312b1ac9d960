// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/lint_dataset.h"

#include <algorithm>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "diorama/error.h"
#include "framework/datasets/capture_sweep.h"
#include "framework/datasets/check_names.h"
#include "framework/datasets/frame_checks.h"
#include "framework/datasets/page_checks.h"
#include "framework/datasets/run_checks.h"
#include "framework/lint/second_opinion.h"

namespace diorama {
namespace {

void take(ReadLog&& log, LintReport& report) {
  report.files += log.files;
  report.checks += log.checks;
  for (Finding& finding : log.findings) report.findings.push_back(lint_finding(std::move(finding)));
}

LintReport lint_read(const StoredDataset& dataset, const std::filesystem::path& folder,
                     Host& host) {
  LintReport report;
  report.dataset = folder.string();
  const StoredInfo& info = dataset.info();
  report.format = info.format;
  ReadLog log = dataset.log();
  const auto planned = check_page(folder, info, log);
  take(std::move(log), report);
  CaptureComparison comparison(info, planned.has_value());
  sweep_captures<StoredCapture>(
      dataset, info.holds, host,
      [&](StoredCapture stored) {
        check_frames(info, stored);
        check_second_opinion(info, stored);
        return stored;
      },
      [&](StoredCapture stored) {
        if (planned) check_planned(*planned, stored, stored.log);
        comparison.add(stored, stored.log);
        take(std::move(stored.log), report);
      });
  return report;
}

/// Datasets of one run, one after the other.
class RunLint {
 public:
  RunLint(DatasetReaders& readers, Host& host) : readers_(readers), host_(host) {}

  /// False for a folder that is no dataset.
  bool lint(const std::filesystem::path& folder, std::string reader) {
    if (reader.empty()) reader = readers_.recognise(folder);
    if (reader.empty()) return false;
    try {
      const std::shared_ptr<const StoredDataset> dataset = readers_.open(folder, reader);
      reports_.push_back(lint_read(*dataset, folder, host_));
      datasets_.push_back({folder.filename().string(), dataset});
    } catch (const Stopped&) {
      throw;
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::Usage || error.kind() == ErrorKind::Internal) throw;
      reports_.push_back({folder.string(), reader, 0, 1, {}});
      reports_.back().findings.push_back(
          lint_finding({kFilesCanBeRead, ".", std::nullopt, "", "", error.what(), ""}));
    }
    return true;
  }

  /// The datasets against each other.
  void lint_run(const std::filesystem::path& run) {
    if (datasets_.empty()) return;
    LintReport report;
    report.dataset = run.string();
    report.format = "run";
    take(check_run(run, datasets_, host_), report);
    if (report.checks > 0 || !report.findings.empty()) reports_.push_back(std::move(report));
  }

  std::vector<LintReport> take_reports() { return std::move(reports_); }
  bool has_reports() const { return !reports_.empty(); }

 private:
  DatasetReaders& readers_;
  Host& host_;
  std::vector<RunDataset> datasets_;
  std::vector<LintReport> reports_;
};

}  // namespace

std::vector<LintReport> lint_datasets(const std::filesystem::path& folder, DatasetReaders& readers,
                                      Host& host, const std::string& reader) {
  if (!std::filesystem::is_directory(folder)) {
    throw Error(ErrorKind::Usage, folder.string() + ": not a folder; give the output of a run");
  }
  if (!reader.empty()) readers.make(reader);
  RunLint run(readers, host);
  if (run.lint(folder, reader)) return run.take_reports();
  for (const auto& path : folders_of_run(folder)) run.lint(path, "");
  if (!run.has_reports()) {
    throw Error(ErrorKind::Usage, folder.string() +
                                      ": holds no dataset that a reader knows, nor do its "
                                      "folders; 'diorama plugins' lists the readers");
  }
  run.lint_run(folder);
  return run.take_reports();
}

LintFinding lint_finding(Finding finding) {
  std::string message;
  const auto add = [&message](const std::string& text, const char* front) {
    if (!text.empty()) message += (message.empty() ? "" : front) + text;
  };
  if (finding.capture) add("capture " + std::to_string(*finding.capture), "");
  add(finding.camera, ", ");
  add(finding.object, ", ");
  add(finding.found, ": ");
  add(finding.expected, "; right would be: ");
  return {std::move(finding.check), std::move(finding.file),    std::move(message),
          finding.capture,          std::move(finding.camera),  std::move(finding.object),
          std::move(finding.found), std::move(finding.expected)};
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
      nlohmann::ordered_json entry{
          {"check", finding.check}, {"file", finding.file}, {"message", finding.message}};
      if (finding.capture) entry["capture"] = *finding.capture;
      for (const auto& [key, value] : {std::pair{"camera", &finding.camera},
                                       {"object", &finding.object},
                                       {"found", &finding.found},
                                       {"expected", &finding.expected}}) {
        if (!value->empty()) entry[key] = *value;
      }
      findings.push_back(std::move(entry));
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
