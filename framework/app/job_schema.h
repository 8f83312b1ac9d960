// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/component.h"
#include "diorama/params.h"

namespace diorama {

/// A component type with its parameters.
struct DescribedComponent {
  ComponentKind kind;
  std::string type;
  std::string help;
  std::vector<ParamSpec> params;
};

/// JSON Schema (draft 2020-12) of a native job, for editors and checks of job files: `job` are the
/// keys of the job itself (job_specs()), `components` those that its lists may name. It accepts
/// what the reader accepts, as far as a schema can say it; what depends on other values (names that
/// must differ, moments that must exist) is left to `diorama run --dry-run`.
Value job_schema(const std::vector<ParamSpec>& job,
                 const std::vector<DescribedComponent>& components);

}  // namespace diorama
