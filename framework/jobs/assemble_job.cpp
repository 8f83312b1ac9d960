// SPDX-License-Identifier: Apache-2.0
#include "framework/jobs/assemble_job.h"

#include <algorithm>
#include <map>

#include "framework/config/value_text.h"
#include "framework/host/machine_limits.h"
#include "framework/pipeline/camera_rig.h"
#include "framework/pipeline/capture_memory.h"
#include "framework/pipeline/dataset_description.h"
#include "framework/pipeline/pattern_check.h"
#include "framework/pipeline/scene_setup.h"
#include "framework/plugins/plugin_call.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

/// Instead of what it provides: an annotator that makes what its parameters say, and is therefore
/// of use only where a job lists it.
constexpr const char* kAsListed = "*";

/// Makes components and remembers which plugins they came from.
class Assembler {
 public:
  enum class MissingAssets { Throw, Warn };

  Assembler(Registry& registry, Host& host, MissingAssets missing = MissingAssets::Throw)
      : registry_(registry), host_(host), missing_(missing) {}

  template <class T>
  std::unique_ptr<T> make(const ComponentConfig& config, std::string_view section) {
    if (config.type.empty()) return nullptr;
    const auto keys = host_keys(section);
    try {
      auto made = registry_.make<T>(config.map, config.path, keys, diagnostics_, host_);
      if (made) note_plugin(registry_.entry(T::kKind, config.type));
      return made;
    } catch (const Error& error) {
      if (missing_ == MissingAssets::Throw || error.kind() != ErrorKind::Asset) throw;
      host_.log(LogLevel::Warning, error.what());
      return nullptr;
    }
  }

  /// The loader, if any, that reads an asset of the job through the host.
  void note_loader(const std::optional<std::string>& type) {
    if (type) note_plugin(registry_.entry(ComponentKind::Loader, *type));
  }

  /// The program's own come first, so that a plugin that is merely there changes no job.
  std::vector<std::string> annotator_types() const {
    std::vector<std::string> types = registry_.types(ComponentKind::Annotator);
    std::ranges::stable_partition(
        types, [&](const std::string& type) { return annotator_entry(type).file.empty(); });
    return types;
  }
  const ComponentEntry& annotator_entry(const std::string& type) const {
    return registry_.entry(ComponentKind::Annotator, type);
  }
  /// One that the job does not list; it must be what its plugin lists, by which it was chosen.
  std::unique_ptr<Annotator> make_default_annotator(const std::string& type) {
    Value map = Value::make_map();
    map.set("type", Value::text(type));
    const auto keys = host_keys("annotators");
    auto made = registry_.make<Annotator>(map, "annotator", keys, diagnostics_, host_);
    diagnostics_.raise();
    const ComponentEntry& entry = annotator_entry(type);
    call_component("annotator '" + type + "'", [&] {
      require_listed("needs", made->needs(), entry.needs);
      require_listed("provides", made->provides(), entry.provides);
    });
    return made;
  }
  void note_annotator(const std::string& type) {
    const ComponentEntry& entry = registry_.entry(ComponentKind::Annotator, type);
    if (!entry.file.empty()) note_plugin(entry);
  }
  void warn_of_idle(const AnnotatorOffer& annotator) {
    std::string made;
    for (const std::string& name : annotator.provides) made += (made.empty() ? "" : ", ") + name;
    host_.log(LogLevel::Warning, "annotators: " + annotator.type +
                                     " does nothing, as no writer needs what it makes (" + made +
                                     ")");
  }

  Diagnostics& diagnostics() { return diagnostics_; }
  std::vector<std::pair<std::string, std::string>> plugins() const {
    return {plugins_.begin(), plugins_.end()};
  }

 private:
  static void require_listed(const char* what, const NameSet& names,
                             const std::vector<std::string>& listed) {
    if (names == NameSet(listed.begin(), listed.end())) return;
    std::string found;
    for (const std::string& name : names) found += (found.empty() ? "" : " ") + name;
    std::string expected;
    for (const std::string& name : listed) expected += (expected.empty() ? "" : " ") + name;
    throw Error(ErrorKind::Plugin, std::string(what) + " other names (" + found +
                                       ") than its plugin lists (" + expected +
                                       "); mend its DIORAMA_ADD_ANNOTATOR");
  }

  void note_plugin(const ComponentEntry& entry) { plugins_[entry.plugin] = entry.version; }

  Registry& registry_;
  Host& host_;
  MissingAssets missing_;
  Diagnostics diagnostics_;
  std::map<std::string, std::string> plugins_;
};

std::vector<std::string> assets_of(const Loader& loader, const ComponentConfig& config) {
  return call_component(config.map.place.text() + ": " + config.path + " (" + config.type + ")",
                        [&] { return loader.assets(); });
}

/// Loaders that the run itself does not use.
struct JobLoaders {
  std::map<std::string, std::unique_ptr<Loader>> of_files;  ///< By type, for the host.
  std::vector<std::unique_ptr<Loader>> of_objects;          ///< Name the assets, group by group.
};

JobLoaders make_loaders(Assembler& assembler, JobAssembly& assembly) {
  JobLoaders loaders;
  const Job& job = assembly.job;
  for (const ComponentConfig& config : job.loaders) {
    loaders.of_files[config.type] = assembler.make<Loader>(config, "loaders");
  }
  for (const ComponentConfig& config : job.environments) {
    assembly.components.sets.front().environments.push_back(
        assembler.make<Loader>(config, "environments"));
  }
  for (const ObjectGroup& group : job.objects) {
    loaders.of_objects.push_back(assembler.make<Loader>(group.loader, "objects"));
  }
  return loaders;
}

void make_randomizers(Assembler& assembler, JobAssembly& assembly) {
  for (const RandomizerEntry& entry : assembly.job.randomizers) {
    assembly.components.sets.front().randomizers.push_back(
        assembler.make<Randomizer>(entry.component, "randomizers"));
  }
}

void make_engines(Assembler& assembler, JobAssembly& assembly) {
  const Job& job = assembly.job;
  VisitComponents& set = assembly.components.sets.front();
  if (job.physics.type != "none") {
    set.physics = assembler.make<PhysicsBackend>(job.physics, "physics");
  }
  set.renderer = assembler.make<Renderer>(job.renderer, "renderer");
}

void make_writers(Assembler& assembler, JobAssembly& assembly) {
  for (const WriterEntry& entry : assembly.job.writers) {
    assembly.components.writers.push_back(assembler.make<Writer>(entry.component, "writers"));
  }
}

/// Those that the job lists, in its order.
using ListedAnnotators = std::vector<std::unique_ptr<Annotator>>;

ListedAnnotators make_annotators(Assembler& assembler, const Job& job) {
  ListedAnnotators listed;
  for (const ComponentConfig& config : job.annotators) {
    listed.push_back(assembler.make<Annotator>(config, "annotators"));
  }
  return listed;
}

CapturePlan plan_from_assets(const JobAssembly& assembly,
                             const std::vector<std::unique_ptr<Loader>>& object_loaders) {
  const Job& job = assembly.job;
  std::vector<EnvironmentChoice> environments;
  for (std::size_t i = 0; i < job.environments.size(); ++i) {
    const Loader& loader = *assembly.components.sets.front().environments[i];
    for (std::string& asset : assets_of(loader, job.environments[i])) {
      environments.push_back({std::move(asset), i});
    }
  }
  if (environments.empty()) {
    throw Error(ErrorKind::Asset, job.environments.front().map.place.text() +
                                      ": environments: the entries name no environment; give "
                                      "folders that hold scenes, or files");
  }
  std::vector<std::vector<std::string>> object_assets;
  for (std::size_t i = 0; i < job.objects.size(); ++i) {
    object_assets.push_back(job.objects[i].count == 0
                                ? std::vector<std::string>()
                                : assets_of(*object_loaders[i], job.objects[i].loader));
  }
  return plan_captures(job, std::move(environments), object_assets);
}

/// A folder that holds more than is used may be a mistake.
void tell_unused_assets(const JobAssembly& assembly, const std::optional<fs::path>& assets_root,
                        Host& host) {
  constexpr std::size_t kNamed = 12;
  const auto unused = unused_assets(assembly.job, assembly.plan);
  for (std::size_t i = 0; i < unused.size(); ++i) {
    if (unused[i].empty()) continue;
    std::string names;
    for (std::size_t k = 0; k < std::min(kNamed, unused[i].size()); ++k) {
      names += (k > 0 ? ", " : "") + asset_name(unused[i][k], assets_root);
    }
    if (unused[i].size() > kNamed) {
      names += " and " + std::to_string(unused[i].size() - kNamed) + " more";
    }
    host.log(LogLevel::Info,
             "objects '" + assembly.job.objects[i].name + "': " + std::to_string(unused[i].size()) +
                 " of " + std::to_string(assembly.plan.object_assets[i].size()) +
                 " assets are left out ('pick: per_visit', 'balance: true' or a larger 'count' "
                 "takes more): " +
                 names);
  }
}

std::vector<Need> needs_of(const JobAssembly& assembly) {
  std::vector<Need> needs;
  for (std::size_t i = 0; i < assembly.components.writers.size(); ++i) {
    const std::string who = "writer '" + assembly.job.writers[i].name + "'";
    const Writer& writer = *assembly.components.writers[i];
    needs.push_back({who, call_component(who, [&] { return writer.needs(); })});
  }
  for (const ViewRule& rule : assembly.job.views) {
    Need need{"views '" + rule.name + "'", {std::string(kLeafId.name)}};
    if (rule.brightness.is_set()) need.names.emplace(kColor.name);
    needs.push_back(std::move(need));
  }
  return needs;
}

/// Chooses among all annotators: those that the job lists, and the others by what their plugins
/// say of them. Only what is chosen is made.
void resolve_needs(Assembler& assembler, ListedAnnotators listed, JobAssembly& assembly) {
  std::vector<AnnotatorOffer> offers;
  std::vector<std::optional<std::size_t>> entries;  // of the job, by offer
  for (const std::string& type : assembler.annotator_types()) {
    const std::size_t before = offers.size();
    for (std::size_t i = 0; i < listed.size(); ++i) {
      const ComponentConfig& config = assembly.job.annotators[i];
      if (config.type != type) continue;
      call_component("annotator '" + type + "'", [&] {
        offers.push_back({type, listed[i]->needs(), listed[i]->provides(), true,
                          config.map.place.text() + ": " + config.path});
      });
      entries.emplace_back(i);
    }
    if (offers.size() > before) continue;
    const ComponentEntry& entry = assembler.annotator_entry(type);
    if (entry.provides == std::vector<std::string>{kAsListed}) continue;
    offers.push_back({type,
                      {entry.needs.begin(), entry.needs.end()},
                      {entry.provides.begin(), entry.provides.end()},
                      false,
                      {}});
    entries.emplace_back();
  }
  JobComponents& parts = assembly.components;
  VisitComponents& set = parts.sets.front();
  parts.demand = resolve_demand(needs_of(assembly), set.renderer->provides(),
                                "renderer '" + assembly.job.renderer.type + "'", offers);
  for (const std::size_t index : parts.demand.annotators) {
    const AnnotatorOffer& offer = offers[index];
    const std::optional<std::size_t> entry = entries[index];
    assembler.note_annotator(offer.type);
    set.annotators.push_back(
        {offer.type, entry,
         entry ? std::move(listed[*entry]) : assembler.make_default_annotator(offer.type)});
  }
  for (std::size_t i = 0; i < offers.size(); ++i) {
    if (entries[i] && listed[*entries[i]]) assembler.warn_of_idle(offers[i]);
  }
}

/// One more set of what works on a visit, with the same parameters as the first.
void add_set(Assembler& assembler, JobAssembly& assembly) {
  const Job& job = assembly.job;
  VisitComponents set;
  for (const ComponentConfig& config : job.environments) {
    set.environments.push_back(assembler.make<Loader>(config, "environments"));
  }
  for (const RandomizerEntry& entry : job.randomizers) {
    set.randomizers.push_back(assembler.make<Randomizer>(entry.component, "randomizers"));
  }
  if (job.physics.type != "none") {
    set.physics = assembler.make<PhysicsBackend>(job.physics, "physics");
  }
  set.renderer = assembler.make<Renderer>(job.renderer, "renderer");
  ListedAnnotators listed = make_annotators(assembler, job);
  for (const auto& [type, entry, first] : assembly.components.sets.front().annotators) {
    set.annotators.push_back(
        {type, entry, entry ? std::move(listed[*entry]) : assembler.make_default_annotator(type)});
  }
  assembler.diagnostics().raise();
  assembly.components.sets.push_back(std::move(set));
}

std::vector<std::string> texts_of(const std::vector<fs::path>& paths) {
  std::vector<std::string> texts;
  for (const fs::path& path : paths) texts.push_back(path.string());
  return texts;
}

/// A dataset does not change when it is written to another folder.
std::string portable_job(Value resolved) {
  if (Value* output = resolved.find("output")) output->erase("folder");
  return to_yaml(resolved);
}

}  // namespace

DescribeComponent describe_from(Registry& registry) {
  return [&registry](ComponentKind kind,
                     std::string_view type) -> std::optional<std::vector<ParamSpec>> {
    if (!registry.has(kind, type)) return std::nullopt;
    return registry.describe(kind, type);
  };
}

int visits_at_a_time(const JobAssembly& assembly, const HostServices& host, int asked) {
  const int wanted = asked > 0 ? asked
                               : default_visits_in_flight(host.thread_count(), available_memory(),
                                                          memory_of(assembly));
  return std::min(wanted, assembly.plan.visit_count());
}

CaptureMemory memory_of(const JobAssembly& assembly) {
  const JobComponents& parts = assembly.components;
  const VisitComponents& set = parts.sets.front();
  std::vector<Camera> cameras;
  for (const PlannedCamera& planned : planned_cameras(assembly.job.cameras)) {
    cameras.push_back(planned.camera);
  }
  NameSet channels = parts.demand.channels;
  for (const auto& named : set.annotators) channels.merge(named.annotator->provides());
  if (parts.demand.motion) channels.emplace(kMotion.name);
  if (parts.demand.flow_forward) {
    channels.emplace(kFlowForward.name);
    channels.emplace(kFlowForwardState.name);
  }
  if (parts.demand.flow_backward) {
    channels.emplace(kFlowBackward.name);
    channels.emplace(kFlowBackwardState.name);
  }
  return capture_memory(cameras, channels, *set.renderer);
}

OutputFolders output_folders(const Job& job) {
  const fs::path base = (fs::path(job.output.folder) / ".").lexically_normal();
  const auto below = [&](const std::string& name) {
    const fs::path place = (base / name).lexically_normal().lexically_relative(base);
    std::string text = place.has_filename() ? place.string() : place.parent_path().string();
    if (text != "." && !is_plain_relative(text)) {
      throw Error(ErrorKind::Internal, "the folder '" + name + "' is not below the output folder");
    }
    return text;
  };
  OutputFolders folders;
  folders.base = job.output.folder;
  folders.records = below(job.output.records);
  for (const WriterEntry& writer : job.writers) {
    folders.writers.push_back({writer.name, below(writer.output_dir.value_or(writer.name))});
  }
  return folders;
}

Value check_job(const Value& value, Registry& registry, Host& host) {
  JobAssembly assembly;
  assembly.components.sets.resize(1);
  Assembler assembler(registry, host);
  assembly.job = read_job(value, assembler.diagnostics());
  make_loaders(assembler, assembly);
  make_randomizers(assembler, assembly);
  make_engines(assembler, assembly);
  make_writers(assembler, assembly);
  make_annotators(assembler, assembly.job);
  assembler.diagnostics().raise();
  return resolved_job(value, describe_from(registry));
}

JobAssembly assemble_job(const Value& value, Registry& registry, HostServices& host,
                         const std::optional<fs::path>& assets_root,
                         const std::string& program_version, AssembleFor purpose,
                         int visits_in_flight) {
  JobAssembly assembly;
  assembly.components.sets.resize(1);
  Assembler assembler(registry, host);
  assembly.job = read_job(value, assembler.diagnostics());
  JobLoaders loaders = make_loaders(assembler, assembly);
  host.take_resolved();
  make_randomizers(assembler, assembly);
  const std::vector<std::string> drawn_assets = texts_of(host.take_resolved());
  const bool is_for_tables = purpose == AssembleFor::Tables;
  if (!is_for_tables) make_engines(assembler, assembly);
  make_writers(assembler, assembly);
  ListedAnnotators annotators;
  if (!is_for_tables) annotators = make_annotators(assembler, assembly.job);
  assembler.diagnostics().raise();
  for (auto& [type, loader] : loaders.of_files) host.use_loader(type, std::move(loader));
  assembly.resolved = resolved_job(value, describe_from(registry));
  assembly.plan = plan_from_assets(assembly, loaders.of_objects);
  assembly.components.environment_patterns =
      check_patterns(assembly.job, assembly.plan, describe_from(registry), assembler.diagnostics());
  assembler.diagnostics().raise();
  tell_unused_assets(assembly, assets_root, host);
  for (const std::string& message : unknown_view_labels(assembly.job, assembly.plan)) {
    host.log(LogLevel::Warning, message);
  }
  if (!is_for_tables) resolve_needs(assembler, std::move(annotators), assembly);
  for (const EnvironmentChoice& choice : assembly.plan.environments) {
    assembler.note_loader(host.loader_of(choice.asset));
  }
  visit_planned_objects(assembly.job, assembly.plan, [&](const PlannedObject& object) {
    assembler.note_loader(host.loader_of(object.asset));
  });
  for (const std::string& asset : drawn_assets) assembler.note_loader(host.loader_of(asset));
  if (assembly.job.writers.empty()) {
    host.log(LogLevel::Warning, "writers: there are none, so the run leaves no pictures");
  }
  if (purpose == AssembleFor::Plan) return assembly;
  assembly.dataset = describe_dataset(
      assembly.job, assembly.plan, portable_job(assembly.resolved), program_version,
      assembler.plugins(), drawn_assets,
      [&](const std::string& asset) {
        return purpose == AssembleFor::Run ? host.files_of(asset) : std::vector<fs::path>();
      },
      assets_root, host);
  assembly.dataset_json = dataset_json(assembly.dataset, assembly.job);
  const int sets = visits_at_a_time(assembly, host, visits_in_flight);
  for (int i = 1; i < sets; ++i) add_set(assembler, assembly);
  return assembly;
}

}  // namespace diorama
