// SPDX-License-Identifier: Apache-2.0
#include "writer_support/channel_list.h"

#include <algorithm>
#include <set>

#include "diorama/error.h"

namespace diorama {
namespace {

constexpr std::string_view kAnnotations[] = {"instances", "visibility", "amodal_mask",
                                             "occlusion_order"};

bool is_plain(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
         c == '-';
}

}  // namespace

void ChannelList::visit(ParamVisitor& v) {
  v.param("channels", names,
          {"Channels that are written as they are, by name, those of other plugins' annotators "
           "too."});
}

void ChannelList::check(std::span<const std::string_view> taken) const {
  std::set<std::string> known;
  for (const std::string& name : names) {
    const auto complain = [&name](const std::string& what) {
      throw Error(ErrorKind::Config, "channels: '" + name + "' " + what);
    };
    if (name.empty() || !std::ranges::all_of(name, is_plain)) {
      complain("is no name of a channel (letters, digits, _ and -)");
    }
    if (std::ranges::count(kAnnotations, name) > 0) complain("is an annotation, not a channel");
    if (!known.insert(name).second) complain("is listed twice");
    if (std::ranges::count(taken, name) > 0) {
      complain("is the name of something that this writer makes in its own way");
    }
  }
}

}  // namespace diorama
