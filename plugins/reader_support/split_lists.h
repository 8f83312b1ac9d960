// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <initializer_list>
#include <map>
#include <string>

#include "reader_support/stored_files.h"

namespace diorama {

/// Reads `folder`/NAME.txt for each split, as far as they are there: the first word of a line is a
/// picture's name. A name that comes again is a finding. The splits by name.
std::map<std::string, std::string> read_split_lists(StoredFiles& files, const std::string& folder,
                                                    std::initializer_list<const char*> splits);

}  // namespace diorama
