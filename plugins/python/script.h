// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/host.h"
#include "diorama/params.h"
#include "python/interpreter.h"

namespace diorama {

/// What a job says of a component in Python.
struct ScriptParams {
  std::string file;
  std::string class_name;
  Value params;
  void visit(ParamVisitor& v) {
    v.param("file", file,
            {"Python file, in a folder that the environment variable DIORAMA_PYTHON_PATH lists."});
    v.param("class", class_name, {"Class in there, derived from one of diorama.plugins."});
    v.param("params", params, {"Values of the parameters that the class declares, by name."});
  }
};

/// An object of a class in a Python file, with its parameters set.
class Script {
 public:
  /// Finds and runs the file, checks `params` by what the class declares and makes the object.
  /// `kind`: "randomizer" or "writer". Throws Error(Config) when the job is wrong, Error(Plugin)
  /// when Python or the class's constructor fails.
  Script(const ScriptParams& params, const char* kind, Host& host);

  /// Calls with the object, as call_python() does.
  template <class Call>
  auto call(Call&& call) const {
    return call_python(file_, host_, [&] { return call(object_.get()); });
  }

 private:
  Host& host_;
  std::string file_;
  SharedObject object_;
};

}  // namespace diorama
