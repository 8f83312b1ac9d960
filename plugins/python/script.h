// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <utility>
#include <vector>

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

/// These, and below `params` what each class declares: of the files that the process has run, or,
/// where it has run none, of all in the user's folders. `kind`: "randomizer" ... as diorama.plugins
/// has them.
std::vector<ParamSpec> describe_scripts(const char* kind);

/// A file that may be run.
struct ScriptFile {
  std::string name;  ///< As a job would write it.
  std::string path;
};

/// All right in the user's folders that import diorama.plugins and hold the word.
std::vector<ScriptFile> script_files(std::string_view word);

/// An object of a class in a Python file, with its parameters set.
class Script {
 public:
  /// Finds and runs the file, checks `params` by what the class declares and makes the object.
  /// Throws Error(Config) when the job is wrong, Error(Plugin) when Python or the class's
  /// constructor fails.
  Script(const ScriptParams& params, const char* kind, Host& host);

  /// Calls with the object, as call_python() does.
  template <class Call>
  auto call(Call&& call) const {
    return call_python(file_, host_, [&] { return call(object_.get()); });
  }
  const std::string& file() const { return file_; }
  /// Where the class stands, for messages: "edges.py: Edges".
  std::string title() const { return file_ + ": " + class_name_; }

 private:
  Host& host_;
  std::string file_;
  std::string class_name_;
  SharedObject object_;
};

}  // namespace diorama
