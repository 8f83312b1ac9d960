// SPDX-License-Identifier: Apache-2.0
#include "diorama/reader.h"

#include <iterator>
#include <utility>

namespace diorama {

StoredDataset::~StoredDataset() = default;
Reader::~Reader() = default;

void ReadLog::check(bool holds, Finding finding) {
  ++checks;
  if (!holds) findings.push_back(std::move(finding));
}

void ReadLog::add(ReadLog&& more) {
  findings.insert(findings.end(), std::make_move_iterator(more.findings.begin()),
                  std::make_move_iterator(more.findings.end()));
  files += more.files;
  checks += more.checks;
}

}  // namespace diorama
