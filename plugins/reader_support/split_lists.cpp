// SPDX-License-Identifier: Apache-2.0
#include "reader_support/split_lists.h"

#include "reader_support/label_text.h"

namespace diorama {

std::map<std::string, std::string> read_split_lists(StoredFiles& files, const std::string& folder,
                                                    std::initializer_list<const char*> splits) {
  std::map<std::string, std::string> split_of;
  for (const char* split : splits) {
    const std::string file = folder + "/" + split + ".txt";
    if (!files.has(file)) continue;
    const auto text = files.text(file);
    if (!text) continue;
    for (const std::string& line : text_lines(*text)) {
      const auto words = text_words(line);
      if (words.empty()) continue;
      const auto [known, is_new] = split_of.emplace(words[0], split);
      files.check(is_new, kOnce, file, words[0], "is in '" + known->second + "' too");
    }
  }
  return split_of;
}

}  // namespace diorama
