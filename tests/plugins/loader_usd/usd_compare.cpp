// SPDX-License-Identifier: Apache-2.0
//
// usd_compare FILE                  prints what our reader says about a stage
// usd_compare FILE EXPECTED.json    prints the differences as well
#include <fstream>
#include <iostream>

#include "plugins/loader_usd/stage_dump.h"

int main(int count, char** arguments) {
  if (count < 2 || count > 3) {
    std::cerr << "usage: usd_compare FILE [EXPECTED.json]\n";
    return 2;
  }
  const auto ours = diorama::usd::test::dump_stage(arguments[1]);
  if (count == 2) {
    std::cout << ours.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
    return 0;
  }
  std::ifstream file(arguments[2]);
  const auto differences = diorama::usd::test::compare_dumps(ours, nlohmann::json::parse(file));
  for (const std::string& difference : differences) std::cout << difference << '\n';
  return differences.empty() ? 0 : 1;
}
