// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "diorama/config.h"

/// Changes to a job from outside of its file.
namespace diorama {

/// Puts `over` on top of `base`: mappings are merged key by key at every depth, everything else is
/// replaced. A null in `over` replaces too.
void merge(Value& base, const Value& over);

/// Applies one `path=value` of the command line. The path's parts are separated by dots; in a list
/// a part is an index from 0 or the `name` (else the `type`) of an entry: `renderer.samples=64`,
/// `cameras[0].width=320`, `writers.basic.rgb=false`; `cameras.0` is another spelling of
/// `cameras[0]`. The value is YAML. Missing mappings are made. Throws Error(Usage) that says which
/// part does not fit.
void apply_set(Value& job, std::string_view assignment);

}  // namespace diorama
