// SPDX-License-Identifier: Apache-2.0
#include "framework/view/report.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diorama/error.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

/// What is held, and the word for it in addresses: of many bits per pixel.
constexpr std::array<std::pair<std::string_view, const char*>, 6> kLargeOverlays{
    {{kDistanceToImagePlane.name, "depth"},
     {kDistanceToCamera.name, "depth"},
     {kNormals.name, "normals"},
     {kMotion.name, "motion"},
     {kFlowForward.name, "flow_forward"},
     {kFlowBackward.name, "flow_backward"}}};

/// Pages from files may not ask for files, but run scripts and show pictures: data is scripts.
class ReportWriter {
 public:
  ReportWriter(DatasetView& view, fs::path folder, bool has_all_overlays)
      : view_(view), folder_(std::move(folder)), has_all_overlays_(has_all_overlays) {}

  ReportSize write() {
    make_folder(folder_);
    finish_work();  // Before there is a file: what fails here may be tried again.
    make_folder(folder_ / "data");
    write_page();
    add_data("/api/state");
    add_data("/api/run");
    add_data("/api/lint");
    const std::vector<DatasetView::Shown> all = view_.shown();
    for (std::size_t i = 0; i < all.size(); ++i) write_dataset("/api/" + std::to_string(i), all[i]);
    return size_;
  }

 private:
  static void make_folder(const fs::path& folder) {
    std::error_code failed;
    fs::create_directories(folder, failed);
    if (failed) throw Error(ErrorKind::Output, folder.string() + ": " + failed.message());
  }

  void put(const std::string& name, std::string_view bytes) {
    std::ofstream file(folder_ / name, std::ios::binary);
    file << bytes;
    file.close();
    if (!file) throw Error(ErrorKind::Output, (folder_ / name).string() + ": cannot be written");
    ++size_.files;
    size_.bytes += bytes.size();
  }

  void write_page() {
    std::string page = *view_.answer("/").body;
    // The headers of the server, as far as a page can say them itself.
    const std::string policy =
        "<meta http-equiv='Content-Security-Policy' content=\"default-src 'none'; script-src "
        "'self' file:; style-src 'self' file:; img-src 'self' file: data: blob:; base-uri 'none'; "
        "form-action 'none'\">\n<meta name='diorama' content='report'>\n";
    page.insert(page.find("<meta"), policy);
    put("index.html", page);
    for (const char* name : {"view.js", "view.css", "icon.svg"}) {
      put(name, *view_.answer(std::string("/") + name).body);
    }
  }

  /// Index, statistics and findings of everything.
  void finish_work() {
    view_.answer("/api/lint");
    const std::size_t count = view_.shown().size();
    for (std::size_t i = 0; i < count; ++i) view_.answer("/api/" + std::to_string(i) + "/stats");
    while (view_.work()) {
    }
  }

  static std::string file_name(const std::string& path) {
    std::string name = path.substr(std::string_view("/api/").size());
    std::ranges::replace(name, '/', '_');
    return "data/" + name;
  }

  /// False when there is nothing at this address, or to be looked for elsewhere.
  bool add_data(const std::string& path,
                const std::function<std::string(const std::string&)>& adapt = {}) {
    const HttpAnswer answer = view_.answer(path);
    if (answer.status == 404) return false;
    if (answer.status == 204) {
      put(file_name(path) + ".js", "diorama_data('" + path + "',null);\n");
      return false;
    }
    const bool is_json = answer.type == "application/json";
    const std::string json =
        !is_json ? "\"data:" + answer.type + ";base64," + base64(*answer.body) + "\""
        : adapt  ? adapt(*answer.body)
                 : *answer.body;
    put(file_name(path) + ".js", "diorama_data('" + path + "','" + quoted(json) + "');\n");
    return true;
  }

  /// As a text of a script. As it stands it would be no JSON there: a key "__proto__" is none.
  static std::string quoted(std::string_view json) {
    std::string text;
    text.reserve(json.size() + json.size() / 8);
    for (const char letter : json) {
      if (letter == '\n') continue;  // between words; in texts there are none
      if (letter == '\\' || letter == '\'') text += '\\';
      text += letter;
    }
    return text;
  }

  /// Under the address by which the page asks for it.
  void add_picture(const std::string& path, const std::string& asked) {
    const HttpAnswer answer = view_.answer(path);
    if (answer.status == 200) put(file_name(asked), *answer.body);
  }

  /// What the report lacks, its page need not ask for.
  std::string info_of_report(const std::string& text) const {
    nlohmann::json info = nlohmann::json::parse(text);
    if (!has_all_overlays_) {
      NameSet holds = info["holds"].get<NameSet>();
      for (const auto& [held, kind] : kLargeOverlays) holds.erase(std::string(held));
      info["holds"] = holds;
    }
    return info.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  }

  void write_dataset(const std::string& at, const DatasetView::Shown& shown) {
    add_data(at + "/info", [this](const std::string& text) { return info_of_report(text); });
    add_data(at + "/stats");
    for (std::size_t i = 0; i == 0 || i < shown.captures.size(); i += DatasetView::kIndexPart) {
      add_data(at + "/index/" + std::to_string(i));
      add_data(at + "/brightness/" + std::to_string(i));
    }
    std::set<std::string> kinds;
    for (const auto& [held, kind] : kLargeOverlays) {
      if (has_all_overlays_ && shown.holds.contains(held)) kinds.insert(kind);
    }
    for (const int capture : shown.captures) {
      const std::string address = at + "/capture/" + std::to_string(capture);
      add_data(address);
      for (std::size_t f = 0; f < shown.cameras.size(); ++f) {
        const std::string frame = address + "/" + std::to_string(f);
        // Small enough for mails; nothing on the page reads colours.
        add_picture(frame + "/photo", frame + "/color");
        add_picture(frame + "/thumbnail", frame + "/thumbnail");
        const bool has_masks = shown.holds.contains(kInstanceId.name);
        if (has_masks && !add_data(frame + "/ids")) add_data(frame + "/masks");
        if (shown.holds.contains("amodal_mask")) add_data(frame + "/amodal");
        for (const std::string& kind : kinds) add_data(frame + "/" + kind);
      }
      ++size_.captures;
    }
  }

  static std::string base64(std::string_view bytes) {
    static constexpr std::string_view kDigits =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    text.reserve((bytes.size() + 2) / 3 * 4);
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
      std::uint32_t three = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        three = three << 8 | (i + k < bytes.size() ? std::uint8_t(bytes[i + k]) : 0U);
      }
      for (std::size_t k = 0; k < 4; ++k) {
        text += i + k > bytes.size() ? '=' : kDigits[three >> (18 - 6 * k) & 63];
      }
    }
    return text;
  }

  DatasetView& view_;
  fs::path folder_;
  bool has_all_overlays_;
  ReportSize size_;
};

}  // namespace

ReportSize write_report(DatasetView& view, const fs::path& folder, bool has_all_overlays) {
  if (view.shown().empty()) {
    throw Error(ErrorKind::Usage, view.folder().string() +
                                      ": the run has made nothing that could be read yet; try "
                                      "again when it has");
  }
  std::error_code ignored;
  if (fs::exists(folder, ignored) && !fs::is_empty(folder, ignored)) {
    throw Error(ErrorKind::Output,
                folder.string() + ": is not empty; name a folder that is not there yet");
  }
  return ReportWriter(view, folder, has_all_overlays).write();
}

}  // namespace diorama
