// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "framework/conformance/check_run.h"
#include "framework/host/host_services.h"
#include "framework/plugins/registry.h"

/// What components of each kind must hold, beyond their parameters.
namespace diorama::conformance {

/// Makes components of one type. Hosts with one and with two threads, as nothing may depend on the
/// number.
struct Subject {
  const ComponentEntry& entry;
  Registry& registry;
  HostServices& host;
  HostServices& single_threaded_host;

  /// With defaults, or with the keys of `params`. Throws Error(Config) for bad parameters.
  template <class T>
  std::unique_ptr<T> make(Host& on, Value params = Value::make_map()) const {
    params.set("type", Value::text(entry.type));
    Diagnostics diagnostics;
    std::unique_ptr<T> made = registry.make<T>(params, "check", {}, diagnostics, on);
    diagnostics.raise();
    return made;
  }
  template <class T>
  std::unique_ptr<T> make() const {
    return make<T>(host);
  }
};

/// A writer's parameters with every switch on, so that as much as possible is written. Nothing when
/// it has none, or when its switches exclude each other, which a component may say.
std::optional<Value> usable_switches(const Subject& subject);

/// Documented; defaults valid; unknown keys, wrong types, unknown words and values out of range
/// refused. False when no component can be made with the defaults.
bool check_parameters(const CheckRun& run, const Subject& subject);

void check_loader(const CheckRun& run, const Subject& subject);
void check_physics(const CheckRun& run, const Subject& subject);
void check_randomizer(const CheckRun& run, const Subject& subject);
void check_renderer(const CheckRun& run, const Subject& subject);
void check_annotator(const CheckRun& run, const Subject& subject);
void check_writer(const CheckRun& run, const Subject& subject);
void check_reader(const CheckRun& run, const Subject& subject);

/// All that a component makes of the same input, as bytes: must be equal in every process. May
/// throw.
std::string loader_output(const Subject& subject);
std::string physics_output(const Subject& subject);
std::string randomizer_output(const Subject& subject);
std::string renderer_output(const Subject& subject);
std::string annotator_output(const Subject& subject);
std::string writer_output(const Subject& subject);
std::string reader_output(const Subject& subject);

}  // namespace diorama::conformance
