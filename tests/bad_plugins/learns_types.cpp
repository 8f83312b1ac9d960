// SPDX-License-Identifier: Apache-2.0
// Good: one listed writer, and writers that are known at run time only, with parameters of their
// own.
#include "test_writer.h"

namespace diorama::test {

struct Script {
  std::string type;
  std::string help;
  std::string key;
  int least = 0;
};

class Scripted final : public QuietWriter {
 public:
  struct Params {
    explicit Params(const Script& about) : script(&about), number(about.least) {}
    const Script* script;
    int number;
    void visit(ParamVisitor& v) {
      v.param(script->key.c_str(), number, {"A number.", "", double(script->least), 9});
    }
  };
  Scripted(Params params, Host& host) : QuietWriter({}, host), params_(params) {}
  NameSet needs() const override { return {params_.script->key + std::to_string(params_.number)}; }

 private:
  Params params_;
};

/// As if they had been read from a folder.
const std::vector<Script>& scripts() {
  static const std::vector<Script> found{{"script_a", "Writes A.", "amount", 1},
                                         {"script_b", "Writes B.", "breadth", 4}};
  return found;
}

}  // namespace diorama::test

DIORAMA_PLUGIN("learns_types", "1.0.0", "MIT") {
  using namespace diorama::test;
  DIORAMA_ADD(QuietWriter, "fixed", "Writes nothing.");
  DIORAMA_LEARNS_TYPES();
  for (const Script& script : scripts()) {
    diorama::add<Scripted>(registrar, script.type.c_str(), script.help.c_str(), {}, script);
  }
}
