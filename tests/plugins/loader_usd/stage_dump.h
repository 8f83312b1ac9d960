// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace diorama::usd::test {

/// What our reader says about a stage, in the form of the shared expected values. A file that
/// cannot be opened gives {"opens": false, "error": ...}.
nlohmann::json dump_stage(const std::string& file);

/// Differences between our dump and the expected one, the first few of them; empty when equal.
/// Counts and texts must be equal, boxes within 1e-4 and translations within 1e-6 of the stage's
/// size, the rest of a matrix within 1e-6 of its largest number, other numbers within 1e-6.
std::vector<std::string> compare_dumps(const nlohmann::json& ours, const nlohmann::json& expected);

}  // namespace diorama::usd::test
