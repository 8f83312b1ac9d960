// SPDX-License-Identifier: Apache-2.0
#include "framework/plugins/conformance.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>

#include "diorama/annotator.h"
#include "diorama/loader.h"
#include "diorama/physics_backend.h"
#include "diorama/randomizer.h"
#include "diorama/renderer.h"
#include "diorama/writer.h"
#include "framework/host/host_services.h"
#include "framework/plugins/registry.h"

namespace diorama {
namespace {

void require(bool is_met, const std::string& failure) {
  if (!is_met) throw Error(ErrorKind::Plugin, failure);
}

/// Takes files and checks their names.
class NamedFiles final : public DatasetFiles {
 public:
  void add(std::string_view path, std::vector<std::byte>) override {
    const std::filesystem::path relative(path);
    const bool leaves = std::find(relative.begin(), relative.end(), "..") != relative.end();
    require(!path.empty() && relative.is_relative() && !leaves,
            "writes '" + std::string(path) + "', which lies outside of its folder");
  }
};

class Conformance {
 public:
  Conformance(Registry& registry, HostServices& host) : registry_(registry), host_(host) {}
  std::vector<CheckResult> results;

  void examine(const ComponentEntry& entry) {
    subject_ = std::string(kind_name(entry.kind)) + "/" + entry.type;
    std::vector<ParamSpec> specs;
    check("parameters are documented", [&] {
      specs = registry_.describe(entry.kind, entry.type);
      require(!entry.help.empty() && entry.help.back() == '.', "its help is no sentence");
      for (const ParamSpec& spec : specs) check_spec(spec);
    });
    check("defaults are valid", [&] { made(entry, job_entry(entry)); });
    check("unknown keys are refused", [&] {
      Value map = job_entry(entry);
      map.set("no_such_key_here", Value::integer(1));
      require_complaint(entry, map, "no_such_key_here");
    });
    check("wrong types are refused", [&] {
      for (const ParamSpec& spec : specs) check_wrong_type(entry, spec);
    });
    check("values out of range are refused", [&] {
      for (const ParamSpec& spec : specs) check_range(entry, spec);
    });
    check_kind(entry);
  }

 private:
  void check(const std::string& name, const std::function<void()>& body) {
    try {
      body();
      results.push_back({subject_, name, ""});
    } catch (const std::exception& error) {
      results.push_back({subject_, name, error.what()});
    } catch (...) {
      results.push_back({subject_, name, "threw something that is no std::exception"});
    }
  }

  static Value job_entry(const ComponentEntry& entry) {
    Value map = Value::make_map();
    map.set("type", Value::text(entry.type));
    return map;
  }

  static void check_spec(const ParamSpec& spec) {
    require(!spec.key.empty(), "a parameter has no name");
    require(!spec.help.empty() && spec.help.back() == '.',
            "the help of '" + spec.key + "' is no sentence with a full stop");
    require(spec.min <= spec.max, "the range of '" + spec.key + "' is empty");
    for (const ParamSpec& child : spec.children) check_spec(child);
  }

  std::unique_ptr<Component> make(const ComponentEntry& entry, const Value& map,
                                  Complaints& complaints) {
    switch (entry.kind) {
      case ComponentKind::Loader:
        return make_as<Loader>(map, complaints);
      case ComponentKind::Physics:
        return make_as<PhysicsBackend>(map, complaints);
      case ComponentKind::Randomizer:
        return make_as<Randomizer>(map, complaints);
      case ComponentKind::Renderer:
        return make_as<Renderer>(map, complaints);
      case ComponentKind::Annotator:
        return make_as<Annotator>(map, complaints);
      case ComponentKind::Writer:
        return make_as<Writer>(map, complaints);
    }
    return nullptr;
  }
  template <class T>
  std::unique_ptr<T> make_as(const Value& map, Complaints& complaints) {
    return registry_.make<T>(map, "check", {}, complaints, host_);
  }
  std::unique_ptr<Component> made(const ComponentEntry& entry, const Value& map) {
    Complaints complaints;
    std::unique_ptr<Component> component = make(entry, map, complaints);
    complaints.raise();
    return component;
  }

  void require_complaint(const ComponentEntry& entry, const Value& map, const std::string& key) {
    Complaints complaints;
    make(entry, map, complaints);
    const auto& messages = complaints.messages();
    require(std::any_of(messages.begin(), messages.end(),
                        [&](const std::string& text) { return text.find(key) != text.npos; }),
            "no complaint names '" + key + "'");
  }

  void check_wrong_type(const ComponentEntry& entry, const ParamSpec& spec) {
    if (spec.type == ParamType::Any || spec.key == "type") return;
    const bool is_mapping = spec.type == ParamType::Group;
    Value map = job_entry(entry);
    Value odd = Value::make_map();
    odd.set("odd", Value::text("lots"));
    map.set(spec.key, is_mapping ? Value::text("lots") : odd);
    require_complaint(entry, map, spec.key);
  }

  void check_range(const ComponentEntry& entry, const ParamSpec& spec) {
    if (spec.type != ParamType::Int && spec.type != ParamType::Number) return;
    for (const double bad : {spec.min - 1.0, spec.max + 1.0}) {
      if (!std::isfinite(bad) || bad == spec.max || bad == spec.min) continue;
      Value map = job_entry(entry);
      map.set(spec.key, Value::number(bad));
      require_complaint(entry, map, spec.key);
    }
  }

  void check_kind(const ComponentEntry& entry) {
    std::unique_ptr<Component> component;
    try {
      component = made(entry, job_entry(entry));
    } catch (const std::exception&) {
      return;  // reported as "defaults are valid"
    }
    if (auto* loader = dynamic_cast<Loader*>(component.get())) check_loader(*loader, entry);
    if (auto* physics = dynamic_cast<PhysicsBackend*>(component.get())) check_physics(*physics);
    if (auto* randomizer = dynamic_cast<Randomizer*>(component.get()))
      check_randomizer(*randomizer);
    if (auto* renderer = dynamic_cast<Renderer*>(component.get())) check_renderer(*renderer);
    if (auto* annotator = dynamic_cast<Annotator*>(component.get())) {
      check("annotations are named",
            [&] { require(!annotator->provides().empty(), "provides nothing"); });
    }
    if (auto* writer = dynamic_cast<Writer*>(component.get())) check_writer(*writer);
  }

  void check_loader(Loader& loader, const ComponentEntry& entry) {
    check("claims are the listed ones", [&] {
      require(!entry.claims_are_listed || loader.claims() == entry.claims,
              "claims() returns something else than the plugin file lists");
    });
    check("a missing file is an error that names it", [&] {
      for (const std::string& claim : loader.claims()) {
        if (!claim.starts_with('.')) continue;
        const std::string name = "/nowhere/missing" + claim;
        check_missing(loader, name);
      }
    });
  }

  static void check_missing(Loader& loader, const std::string& name) {
    Scene scene;
    const NodeId root = scene.create(scene.root(), "asset");
    try {
      loader.load(name, scene, root);
    } catch (const Error& error) {
      require(std::string(error.what()).find(name) != std::string::npos,
              "the error for a missing file does not name it: " + std::string(error.what()));
      return;
    }
    require(false, "loads " + name + ", which does not exist");
  }

  void check_physics(PhysicsBackend& physics) {
    check("an empty scene stays empty", [&] {
      Scene scene;
      require(physics.step_seconds() > 0, "its steps take no time");
      physics.reset(scene);
      physics.advance(scene, 0);
      physics.advance(scene, 3);
      require(physics.report().moving_bodies == 0, "reports bodies that are not there");
    });
  }

  void check_randomizer(Randomizer& randomizer) {
    check("an empty scene is survived", [&] {
      Scene scene;
      randomizer.randomize(scene, {"environment", -1, Vec3::Zero()}, Rng(1));
    });
  }

  void check_renderer(Renderer& renderer) {
    check("an empty scene gives every channel and is left as it was", [&] {
      Scene scene;
      const NodeId camera = scene.create(scene.root(), "camera");
      scene.edit(camera).camera = Camera::from_lens(19, 11, 24.0, 20.955);
      const std::uint64_t shape = scene.shape_revision();
      const std::uint64_t pose = scene.pose_revision();
      require(!renderer.provides().empty(), "provides nothing");
      renderer.prepare(scene);
      renderer.render({camera, renderer.provides(), 1});
      require(scene.shape_revision() == shape && scene.pose_revision() == pose,
              "changes the scene");
    });
  }

  void check_writer(Writer& writer) {
    check("an empty dataset is survived", [&] {
      NamedFiles files;
      writer.needs();
      writer.begin({}, files);
      writer.finish([](const RecordVisitor&) {}, files);
    });
  }

  Registry& registry_;
  HostServices& host_;
  std::string subject_;
};

}  // namespace

std::vector<CheckResult> check_plugin(const std::filesystem::path& file, const Log& log) {
  const std::string name = file.filename().string();
  PluginSearch search;
  try {
    search.plugins.push_back({read_plugin_file(file), 0});
  } catch (const Error& error) {
    return {{name, "descriptor fits this program", error.what()}};
  }
  const bool has_list = search.plugins.front().plugin.components.has_value();
  Registry registry(std::move(search), log);
  if (!registry.rejected().empty()) {
    return {{name, "the library loads and registers", registry.rejected().front().reason}};
  }
  HostOptions options;
  options.threads = 2;
  HostServices host(registry, options, log);
  Conformance conformance(registry, host);
  conformance.results.push_back({name, "descriptor fits this program", ""});
  conformance.results.push_back(
      {name, "components are listed in the file",
       has_list ? "" : "none are; register with DIORAMA_ADD, so that listing does not load code"});
  for (const ComponentEntry& entry : registry.components()) conformance.examine(entry);
  return std::move(conformance.results);
}

}  // namespace diorama
