// SPDX-License-Identifier: Apache-2.0
// What diorama/__init__.py makes its classes of: plain dictionaries and views of pixels.
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <unistd.h>

#include <atomic>
#include <condition_variable>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "diorama/error.h"
#include "diorama/reader.h"
#include "framework/config/yaml_config.h"
#include "framework/datasets/dataset_readers.h"
#include "framework/jobs/assemble.h"
#include "framework/jobs/assemble_job.h"
#include "framework/jobs/job_file.h"
#include "framework/jobs/run_in_memory.h"
#include "framework/plugins/plugin_search.h"

namespace py = pybind11;

namespace diorama {
namespace {

constexpr const char* kErrorKinds[]{"internal", "usage", "config", "plugin", "asset", "output"};

/// The messages go to logging.getLogger("diorama").
void log_to_python(LogLevel level, std::string_view message) {
  constexpr int kPythonLevels[]{10, 20, 30, 40};
  const py::gil_scoped_acquire lock;
  py::module_::import("logging").attr("getLogger")("diorama").attr("log")(
      kPythonLevels[std::size_t(level)], "%s", std::string(message));
}

/// What all datasets of the process share. Made when the first one is opened, never destroyed:
/// libraries of plugins stay loaded.
class Services {
 public:
  explicit Services(const GlobalOptions& options)
      : services_(make_services(options, log_to_python)),
        readers_(*services_.registry, *services_.host) {}
  DatasetReaders& readers() { return readers_; }

 private:
  JobServices services_;
  DatasetReaders readers_;
};

/// Pixels that keep what they lie in alive and cannot be changed.
template <class Element>
py::array view_of(const Element* data, std::vector<py::ssize_t> shape, const py::capsule& owner) {
  py::array_t<Element> array(std::move(shape), data, owner);
  py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return array;
}

py::array image_view(const AnyImage& any, const py::capsule& owner) {
  return std::visit(
      [&](const auto& image) -> py::array {
        using Pixel = typename std::decay_t<decltype(image)>::PixelType;
        const py::ssize_t height = image.height();
        const py::ssize_t width = image.width();
        if constexpr (std::is_arithmetic_v<Pixel>) {
          return view_of(image.pixels().data(), {height, width}, owner);
        } else {
          constexpr py::ssize_t kParts = sizeof(Pixel) / sizeof(std::declval<Pixel>()[0]);
          return view_of(image.pixels().empty() ? nullptr : &image.pixels()[0][0],
                         {height, width, kParts}, owner);
        }
      },
      any);
}

py::object box_of(const std::optional<PixelBox>& box) {
  if (!box) return py::none();
  return py::make_tuple(box->x_min, box->y_min, box->x_max, box->y_max);
}

py::dict camera_of(const Camera& camera) {
  constexpr const char* kLenses[]{"pinhole", "opencv_pinhole", "fisheye_polynomial"};
  py::dict result;
  result["width"] = camera.width;
  result["height"] = camera.height;
  result["lens"] = kLenses[std::size_t(camera.lens)];
  result["fx"] = camera.fx;
  result["fy"] = camera.fy;
  result["cx"] = camera.cx;
  result["cy"] = camera.cy;
  result["distortion"] = camera.distortion;
  result["fisheye_polynomial"] = camera.fisheye_polynomial;
  result["near_m"] = camera.near_m;
  result["far_m"] = camera.far_m;
  return result;
}

py::object visibility_of(const std::optional<Visibility>& seen, const py::capsule& owner) {
  if (!seen) return py::none();
  py::dict result;
  result["visible_pixels"] = seen->visible_pixels;
  result["amodal_pixels"] = seen->amodal_pixels;
  result["outside_pixels"] = seen->outside_pixels;
  result["occlusion"] = seen->occlusion();
  result["truncation"] = seen->truncation();
  result["amodal_box"] = box_of(seen->amodal_box);
  const CoverageMask& mask = seen->amodal_mask;
  if (mask.bits.empty()) {
    result["amodal_mask"] = py::none();
  } else {
    result["amodal_mask"] = py::make_tuple(
        box_of(mask.box), view_of(mask.bits.data(), {mask.box.height(), mask.box.width()}, owner));
  }
  return result;
}

py::dict instance_of(const Instance& instance, const NameSet& holds, const py::capsule& owner) {
  py::dict result;
  result["id"] = instance.id;
  result["path"] = instance.node_path;
  result["labels"] =
      py::cast(std::map<std::string, std::string>(instance.labels.begin(), instance.labels.end()));
  const auto if_held = [&](std::string_view name, auto make) -> py::object {
    return holds.contains(name) ? py::object(make()) : py::object(py::none());
  };
  result["world_from_object"] =
      if_held(kHoldsPoses, [&] { return py::cast(Mat4(instance.world_from_node.matrix())); });
  result["bounds"] = if_held(kHoldsBounds, [&]() -> py::object {
    const Aabb& bounds = instance.bounds_node;
    if (bounds.is_empty()) return py::none();
    return py::make_tuple(py::cast(bounds.min), py::cast(bounds.max));
  });
  result["box"] = box_of(instance.tight_box);
  result["visibility"] = visibility_of(instance.visibility, owner);
  return result;
}

py::dict frame_of(const Frame& frame, const NameSet& holds, const py::capsule& owner) {
  py::dict result;
  result["camera_name"] = frame.camera_name;
  result["camera"] = camera_of(frame.camera);
  result["world_from_camera"] = holds.contains(kHoldsCameraPose)
                                    ? py::cast(Mat4(frame.world_from_camera.matrix()))
                                    : py::none();
  py::list instances;
  for (const Instance& instance : frame.instances) {
    instances.append(instance_of(instance, holds, owner));
  }
  result["instances"] = instances;
  py::list occlusions;
  for (const Occlusion& occlusion : frame.occlusions) {
    occlusions.append(py::make_tuple(occlusion.front, occlusion.behind, occlusion.pixels));
  }
  result["occlusions"] = occlusions;
  py::dict channels;
  for (const std::string& name : frame.channels()) {
    channels[py::str(name)] = image_view(frame.image_named(name), owner);
  }
  result["channels"] = channels;
  return result;
}

py::dict finding_of(const Finding& finding) {
  py::dict result;
  result["check"] = finding.check;
  result["file"] = finding.file;
  result["capture"] = finding.capture;
  result["camera"] = finding.camera;
  result["object"] = finding.object;
  result["found"] = finding.found;
  result["expected"] = finding.expected;
  return result;
}

py::list findings_of(const ReadLog& log) {
  py::list result;
  for (const Finding& finding : log.findings) result.append(finding_of(finding));
  return result;
}

py::dict capture_of(std::shared_ptr<const StoredCapture> stored, const NameSet& holds) {
  // Every array refers to the capsule, which ends with the last of them.
  auto* const shared = new std::shared_ptr<const StoredCapture>(stored);
  const py::capsule owner(
      shared, [](void* held) { delete static_cast<std::shared_ptr<const StoredCapture>*>(held); });
  py::dict result;
  result["index"] = stored->capture.index;
  result["visit"] = stored->capture.visit;
  result["phase"] = stored->capture.phase;
  result["environment"] = stored->capture.environment;
  result["split"] = stored->split;
  py::list frames;
  for (const Frame& frame : stored->capture.frames) frames.append(frame_of(frame, holds, owner));
  result["frames"] = frames;
  result["findings"] = findings_of(stored->log);
  return result;
}

class OpenDataset {
 public:
  OpenDataset(FoundDataset found, std::unique_ptr<const StoredDataset> dataset)
      : found_(std::move(found)), dataset_(std::move(dataset)) {}

  py::dict info() const {
    const StoredInfo& info = dataset_->info();
    py::dict result;
    result["folder"] = found_.folder.string();
    result["reader"] = found_.reader;
    result["format"] = info.format;
    result["holds"] = std::vector<std::string>(info.holds.begin(), info.holds.end());
    result["cameras"] = info.camera_names;
    result["captures"] = info.captures;
    result["classes"] = info.classes;
    result["findings"] = findings_of(dataset_->log());
    return result;
  }

  py::dict read(std::size_t place, const std::optional<std::vector<std::string>>& wanted) const {
    if (place >= dataset_->info().captures.size()) throw py::index_error();
    NameSet names = dataset_->info().holds;
    if (wanted) names = NameSet(wanted->begin(), wanted->end());
    std::shared_ptr<const StoredCapture> capture;
    {
      const py::gil_scoped_release unlocked;
      capture = std::make_shared<const StoredCapture>(dataset_->read(place, names));
    }
    return capture_of(std::move(capture), dataset_->info().holds);
  }

 private:
  FoundDataset found_;
  std::unique_ptr<const StoredDataset> dataset_;
};

/// After a fork they are made anew: the threads of the old ones are not there, so that those cannot
/// even be destroyed.
Services& services_of(const std::string& program) {
  static Services* services = nullptr;
  static pid_t process = 0;
  if (!services || process != getpid()) {
    GlobalOptions options;
    options.program = program;
    services = new Services(options);
    process = getpid();
  }
  return *services;
}

std::unique_ptr<OpenDataset> open_dataset(const std::string& program, const std::string& folder,
                                          const std::string& reader) {
  DatasetReaders& readers = services_of(program).readers();
  FoundDataset found = find_dataset(folder, readers, reader);
  auto dataset = readers.open(found.folder, found.reader);
  return std::make_unique<OpenDataset>(std::move(found), std::move(dataset));
}

std::vector<std::pair<std::string, std::string>> find_in(const std::string& program,
                                                         const std::string& folder) {
  std::vector<std::pair<std::string, std::string>> all;
  for (const FoundDataset& found : find_datasets(folder, services_of(program).readers())) {
    all.emplace_back(found.folder.string(), found.reader);
  }
  return all;
}

/// Hands captures to a Python function, in their order, one at a time.
class Listener {
 public:
  Listener(py::object on_capture, NameSet needs)
      : on_capture_(std::move(on_capture)), needs_(std::move(needs)) {}

  const NameSet& needs() const { return needs_; }
  bool is_over() const { return is_over_; }
  const std::atomic<bool>& stop() const { return is_over_; }

  /// Called by several threads; those of later captures wait, and with them the run.
  void take(const Capture& capture) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return is_over_ || capture.index == next_; });
    if (!is_over_) call(capture);
    ++next_;
    lock.unlock();
    changed_.notify_all();
  }

  /// Ends the run when the interpreter has a signal to handle: Ctrl-C.
  void look_for_signals() {
    {
      const py::gil_scoped_acquire python;
      if (PyErr_CheckSignals() == 0) return;
      keep(py::error_already_set());
    }
    // Not while the interpreter is locked: who holds this may wait for it.
    const std::lock_guard lock(mutex_);
    is_over_ = true;
    changed_.notify_all();
  }

  /// With the interpreter's lock held: throws what the function threw.
  void rethrow() {
    if (error_) throw py::error_already_set(*error_);
  }

 private:
  void call(const Capture& capture) {
    auto stored = std::make_shared<StoredCapture>();
    stored->capture.index = capture.index;
    stored->capture.visit = capture.visit;
    stored->capture.phase = capture.phase;
    stored->capture.environment = capture.environment;
    for (const Frame& frame : capture.frames) stored->capture.frames.push_back(copy_of(frame));
    const py::gil_scoped_acquire python;
    try {
      const NameSet holds{std::string(kHoldsPoses), std::string(kHoldsBounds),
                          std::string(kHoldsCameraPose)};
      const py::object goes_on = on_capture_(capture_of(std::move(stored), holds));
      if (goes_on.is(py::bool_(false))) is_over_ = true;
    } catch (const py::error_already_set& error) {
      keep(error);
      is_over_ = true;
    }
  }

  /// The first one; the interpreter's lock guards it.
  void keep(const py::error_already_set& error) {
    if (!error_) error_ = error;
  }

  /// The run's own frames end when they are written.
  Frame copy_of(const Frame& frame) const {
    Frame copy;
    copy.camera_name = frame.camera_name;
    copy.camera_path = frame.camera_path;
    copy.camera = frame.camera;
    copy.world_from_camera = frame.world_from_camera;
    copy.instances = frame.instances;
    copy.occlusions = frame.occlusions;
    copy.leaf_paths = frame.leaf_paths;
    copy.exposure = frame.exposure;
    copy.seed = frame.seed;
    for (const std::string& name : frame.channels()) {
      if (!needs_.contains(name)) continue;
      std::visit(
          [&](const auto& image) {
            using Pixel = typename std::decay_t<decltype(image)>::PixelType;
            copy.set(Channel<Pixel>{name}, image);
          },
          frame.image_named(name));
    }
    return copy;
  }

  py::object on_capture_;
  NameSet needs_;
  std::mutex mutex_;
  std::condition_variable changed_;
  int next_ = 0;
  std::optional<py::error_already_set> error_;
  std::atomic<bool> is_over_ = false;
};

// Components are made by name; a process has one such run at a time.
Listener* listener = nullptr;

/// Takes the place of the job's writers.
class ListenerWriter final : public Writer {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };
  ListenerWriter(Params, Host&) {}
  NameSet needs() const override { return listener->needs(); }
  void write(const Capture& capture, CaptureFiles&) const override { listener->take(capture); }
};

void register_listener(Registrar& registrar) {
  add<ListenerWriter>(registrar, "python", "Hands captures to a Python function.");
}

/// Of a file, or of its text when that is not empty.
Value job_value(const std::string& file, const std::string& text,
                const std::vector<std::string>& sets, std::optional<std::uint64_t> seed) {
  JobOptions options;
  options.job = file;
  options.sets = sets;
  options.seed = seed;
  if (text.empty()) return load_job(options, log_to_python);
  return native_job(parse_yaml(text, "job"), options, log_to_python);
}

/// Without output: nothing is written anywhere.
void listen(const std::string& program, const Value& given, const py::object& on_capture,
            const std::vector<std::string>& needs, int threads) {
  if (listener) throw Error(ErrorKind::Usage, "run() with on_capture is at work already");
  GlobalOptions options;
  options.program = program;
  options.threads = threads;
  Value job = given;
  Value writer = Value::make_map();
  writer.set("type", Value::text("python"));
  Value writers = Value::make_list();
  writers.list.push_back(std::move(writer));
  job.set("writers", std::move(writers));

  Listener own(on_capture, NameSet(needs.begin(), needs.end()));
  listener = &own;
  const std::unique_ptr<Listener*, void (*)(Listener**)> forget(
      &listener, [](Listener** held) { *held = nullptr; });
  {
    const py::gil_scoped_release unlocked;
    const JobServices services = make_job_services(options, job, log_to_python, register_listener);
    services.host->stop_on(own.stop());
    JobAssembly assembly = assemble_job(job, *services.registry, *services.host,
                                        services.assets_root, program_version(), AssembleFor::Run);
    RunOptions run;
    run.stop = &own.stop();
    run.encodes_in_order = true;
    run.progress = [&](const RunProgress&) { own.look_for_signals(); };
    try {
      run_in_memory(assembly, *services.host, run);
    } catch (const Interrupted&) {
      // Whoever ended it knows.
    }
  }
  own.rethrow();
}

}  // namespace
}  // namespace diorama

PYBIND11_MODULE(_diorama, module) {
  using namespace diorama;
  module.attr("__version__") = program_version();
  static PyObject* const error_class = PyErr_NewExceptionWithDoc(
      "diorama.Error",
      "Something that Diorama refuses; `kind` is 'usage', 'config', 'plugin', 'asset', 'output' or "
      "'internal'.",
      PyExc_RuntimeError, nullptr);
  module.attr("Error") = py::reinterpret_borrow<py::object>(error_class);
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const Error& error) {
      const py::object raised = py::reinterpret_borrow<py::object>(error_class)(error.what());
      raised.attr("kind") = kErrorKinds[std::size_t(error.kind())];
      PyErr_SetObject(error_class, raised.ptr());
    }
  });
  py::class_<OpenDataset>(module, "OpenDataset")
      .def("info", &OpenDataset::info)
      .def("read", &OpenDataset::read, py::arg("place"), py::arg("wanted") = py::none());
  module.def("open_dataset", &open_dataset, py::arg("program"), py::arg("folder"),
             py::arg("reader") = "");
  module.def(
      "listen",
      [](const std::string& program, const std::string& file, const std::string& text,
         const std::vector<std::string>& sets, std::optional<std::uint64_t> seed,
         const py::object& on_capture, const std::vector<std::string>& needs, int threads) {
        listen(program, job_value(file, text, sets, seed), on_capture, needs, threads);
      },
      py::arg("program"), py::arg("file"), py::arg("text"), py::arg("sets"), py::arg("seed"),
      py::arg("on_capture"), py::arg("needs"), py::arg("threads"));
  module.def("find_datasets", &find_in, py::arg("program"), py::arg("folder"));
}
