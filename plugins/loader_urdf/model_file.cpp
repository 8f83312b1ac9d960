// SPDX-License-Identifier: Apache-2.0
#include "loader_urdf/model_file.h"

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

#include <exception>
#include <fstream>
#include <iterator>
#include <mutex>
#include <string_view>
#include <system_error>

#include "diorama/error.h"
#include "loader_urdf/xml_check.h"

namespace diorama::loader_urdf {
namespace {

namespace fs = std::filesystem;

/// The library takes words of the file for printf formats when it complains about them; a percent
/// sign may be written as a number, too.
bool may_be_format(std::string_view text) {
  return text.find('%') != std::string_view::npos || text.find("&#") != std::string_view::npos;
}

/// Keeps what the library would print. There is one place for that in the process.
class KeptMessages final : public console_bridge::OutputHandler {
 public:
  explicit KeptMessages(std::string_view text)
      : lock_(mutex()), level_before_(console_bridge::getLogLevel()) {
    console_bridge::useOutputHandler(this);
    // Formats nothing at all.
    if (may_be_format(text)) console_bridge::setLogLevel(console_bridge::CONSOLE_BRIDGE_LOG_NONE);
  }
  ~KeptMessages() override {
    console_bridge::setLogLevel(level_before_);
    console_bridge::restorePreviousOutputHandler();
  }

  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR && first_error.empty()) {
      first_error = text;
    }
  }
  std::string first_error;

 private:
  static std::mutex& mutex() {
    static std::mutex one;
    return one;
  }
  std::lock_guard<std::mutex> lock_;
  console_bridge::LogLevel level_before_;
};

bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

/// Messages go to terminals and pages.
std::string plain(std::string text) {
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < ' ' || c == 0x7f) c = ' ';
  }
  return text.substr(0, 300);
}

}  // namespace

urdf::ModelInterfaceSharedPtr read_model(const std::string& file, std::string* complaint) {
  if (!is_file(file)) throw Error(ErrorKind::Asset, file + ": is no regular file");
  std::error_code error;
  const auto bytes = fs::file_size(file, error);
  if (!error && bytes > kMaxXmlBytes) {
    throw Error(ErrorKind::Asset, file + ": has " + std::to_string(bytes) +
                                      " bytes, expected at most " + std::to_string(kMaxXmlBytes));
  }
  std::ifstream stream(file, std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(stream)),
                         std::istreambuf_iterator<char>());
  if (!stream) throw Error(ErrorKind::Asset, file + ": cannot be read");
  check_xml(file, text);
  KeptMessages messages(text);
  urdf::ModelInterfaceSharedPtr model;
  try {
    model = urdf::parseURDF(text);
  } catch (const std::exception& problem) {
    throw Error(ErrorKind::Asset, file + ": is no URDF model: " + plain(problem.what()));
  }
  if (model && model->getRoot()) {
    if (complaint) *complaint = plain(messages.first_error);
    // Links own the links below them, so those in a loop of joints would live for ever.
    return {model.get(), [model](urdf::ModelInterface*) {
              for (const auto& [name, link] : model->links_) {
                link->child_links.clear();
                link->child_joints.clear();
              }
            }};
  }
  throw Error(
      ErrorKind::Asset,
      file + ": is no URDF model" +
          (messages.first_error.empty() ? std::string() : ": " + plain(messages.first_error)));
}

MeshFinder::MeshFinder(const std::string& model_file, const std::vector<std::string>& packages,
                       const Host& host)
    : folder_(fs::path(model_file).parent_path()) {
  for (const std::string& package : packages) packages_.push_back(host.resolve(package));
}

std::optional<fs::path> MeshFinder::find(const std::string& name) const {
  for (const std::string_view scheme : {"package://", "model://"}) {
    if (!name.starts_with(scheme)) continue;
    const std::string rest = name.substr(scheme.size());
    const std::string package = rest.substr(0, rest.find('/'));
    if (package.empty() || package.size() == rest.size()) return std::nullopt;
    const fs::path inside = rest.substr(package.size() + 1);
    for (const fs::path& known : packages_) {
      if (known.filename() == package && is_file(known / inside)) return known / inside;
      if (is_file(known / package / inside)) return known / package / inside;
    }
    std::error_code error;
    for (fs::path up = fs::absolute(folder_, error);; up = up.parent_path()) {
      if (up.filename() == package && is_file(up / inside)) return up / inside;
      if (is_file(up / package / inside)) return up / package / inside;
      if (up == up.parent_path()) return std::nullopt;
    }
  }
  std::string path = name;
  if (path.starts_with("file://")) path = path.substr(7);
  if (path.find("://") != std::string::npos || path.empty()) return std::nullopt;
  const fs::path found = fs::path(path).is_absolute() ? fs::path(path) : folder_ / path;
  if (!is_file(found)) return std::nullopt;
  return found;
}

}  // namespace diorama::loader_urdf
