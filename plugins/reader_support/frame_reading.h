// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

#include "diorama/reader.h"
#include "reader_support/stored_files.h"

namespace diorama {

/// The file that says a thing, by the thing's name.
using FrameSources = std::map<std::string, std::string, std::less<>>;

/// What the reading of one frame begins with, in any format.
class FrameReading {
 protected:
  /// All references must outlive the object.
  FrameReading(const std::filesystem::path& folder, const Host& host, const StoredInfo& info,
               int capture, const std::string& camera, const NameSet& wanted, ReadLog& log);

  /// Asked for, and there.
  bool wants(std::string_view name) const { return wanted_.contains(name) && held_.contains(name); }
  void set_size(const StoredPicture& picture);
  /// An object of which no file says the node: it is called by its number. Not in the frame yet.
  Instance next_instance(const std::string& label) const;
  /// The same, in the frame.
  Instance& add_instance(const std::string& label);

  const NameSet& wanted_;
  StoredFiles files_;
  Frame frame_;

 private:
  const NameSet& held_;
};

}  // namespace diorama
