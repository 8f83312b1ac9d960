// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diorama/annotator.h"
#include "diorama/loader.h"
#include "diorama/physics_backend.h"
#include "diorama/randomizer.h"
#include "diorama/renderer.h"
#include "diorama/writer.h"
#include "framework/pipeline/demand.h"
#include "framework/pipeline/pattern_check.h"

namespace diorama {

/// What works on a visit, in the order of the job. Visits in flight have a set each: an instance is
/// with one visit from its beginning to its end, and called by one thread (ADR 0052).
struct VisitComponents {
  std::vector<std::unique_ptr<Loader>> environments;
  std::unique_ptr<PhysicsBackend> physics;  ///< Null: nothing moves by itself.
  std::unique_ptr<Renderer> renderer;
  std::vector<std::unique_ptr<Randomizer>> randomizers;
  struct NamedAnnotator {
    std::string type;
    std::optional<std::size_t>
        entry;  ///< Of Job::annotators; absent when the job does not list it.
    std::unique_ptr<Annotator> annotator;
  };
  /// Those that the writers' needs ask for, in working order.
  std::vector<NamedAnnotator> annotators;
};

/// Everything that a job's entries turned into.
struct JobComponents {
  std::vector<VisitComponents> sets;             ///< One per visit in flight, at least one.
  std::vector<std::unique_ptr<Writer>> writers;  ///< In the order of the job.
  Demand demand;
  /// They can be tried only once an environment is there.
  std::vector<EnvironmentPattern> environment_patterns;
};

}  // namespace diorama
