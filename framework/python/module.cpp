// SPDX-License-Identifier: Apache-2.0
// What diorama/__init__.py makes its classes of: plain dictionaries and views of pixels.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "diorama/error.h"
#include "diorama/reader.h"
#include "framework/config/yaml_config.h"
#include "framework/datasets/dataset_readers.h"
#include "framework/datasets/pixel_boxes.h"
#include "framework/jobs/assemble.h"
#include "framework/jobs/assemble_job.h"
#include "framework/jobs/job_file.h"
#include "framework/jobs/run_in_memory.h"
#include "framework/plugins/plugin_call.h"
#include "framework/plugins/plugin_search.h"
#include "framework/python/captures.h"
#include "framework/python/given.h"
#include "framework/python/scenes.h"

namespace py = pybind11;

namespace diorama {
namespace {

constexpr const char* kErrorKinds[]{"internal", "usage", "config", "plugin", "asset", "output"};

/// The messages go to logging.getLogger("diorama").
void log_to_python(LogLevel level, std::string_view message) {
  constexpr int kPythonLevels[]{10, 20, 30, 40};
  const py::gil_scoped_acquire lock;
  py::module_::import("logging").attr("getLogger")("diorama").attr("log")(
      kPythonLevels[std::size_t(level)], "%s", text_of(message));
}

/// What all datasets of the process share. Made when the first one is opened, never destroyed:
/// libraries of plugins stay loaded.
class Services {
 public:
  explicit Services(const GlobalOptions& options)
      : services_(make_services(options, log_to_python)),
        readers_(*services_.registry, *services_.host) {}
  /// Calls with the readers, one thread at a time and without the interpreter's lock: opening a
  /// large dataset takes seconds, in which Python goes on.
  template <class Call>
  auto with_readers(Call&& call) {
    const py::gil_scoped_release unlocked;
    const std::lock_guard alone(mutex_);  // a reader in Python may open others itself
    return std::forward<Call>(call)(readers_);
  }

 private:
  JobServices services_;
  DatasetReaders readers_;
  std::recursive_mutex mutex_;
};

class OpenDataset {
 public:
  OpenDataset(FoundDataset found, std::unique_ptr<const StoredDataset> dataset)
      : found_(std::move(found)), dataset_(std::move(dataset)) {}

  py::dict info() const {
    const StoredInfo& info = dataset_->info();
    py::dict result;
    result["folder"] = text_of(found_.folder.string());
    result["reader"] = text_of(found_.reader);
    result["format"] = text_of(info.format);
    result["holds"] = texts_of({info.holds.begin(), info.holds.end()});
    result["cameras"] = texts_of(info.camera_names);
    result["captures"] = info.captures;
    result["classes"] = texts_of(info.classes);
    py::dict skeletons;
    for (const auto& [label, skeleton] : info.skeletons) {
      skeletons[text_of(label)] = py::make_tuple(texts_of(skeleton.names), skeleton.lines);
    }
    result["skeletons"] = skeletons;
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
      const std::string who = "reader of " + dataset_->info().format + ", capture " +
                              std::to_string(dataset_->info().captures[place]);
      StoredCapture stored = call_component(who, [&] { return dataset_->read(place, names); });
      for (Frame& frame : stored.capture.frames) complete_boxes(frame);
      capture = std::make_shared<const StoredCapture>(std::move(stored));
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
  static std::mutex* mutex = new std::mutex;
  static Services* services = nullptr;
  static pid_t process = getpid();
  if (process != getpid()) {  // the only thread of a new process
    process = getpid();
    mutex = new std::mutex;
    services = nullptr;
  }
  // What it logs while it is made goes to Python: others may run meanwhile, and must not make it
  // too.
  const py::gil_scoped_release unlocked;
  const std::lock_guard lock(*mutex);
  if (!services) {
    GlobalOptions options;
    options.program = program;
    services = new Services(options);
  }
  return *services;
}

std::unique_ptr<OpenDataset> open_dataset(const std::string& program, const std::string& folder,
                                          const std::string& reader) {
  return services_of(program).with_readers([&](DatasetReaders& readers) {
    FoundDataset found = find_dataset(folder, readers, reader);
    auto dataset = readers.open(found.folder, found.reader, DatasetReaders::LostCaptures::Throw);
    return std::make_unique<OpenDataset>(std::move(found), std::move(dataset));
  });
}

py::list find_in(const std::string& program, const std::string& folder) {
  const std::vector<FoundDataset> all = services_of(program).with_readers(
      [&](DatasetReaders& readers) { return find_datasets(folder, readers); });
  py::list result;
  for (const FoundDataset& found : all) {
    result.append(py::make_tuple(text_of(found.folder.string()), text_of(found.reader)));
  }
  return result;
}

/// Hands captures to a Python function, in their order, one at a time, in the thread that waits for
/// them: what holds for that thread alone (torch.no_grad(), autocast) holds in the function, and
/// Ctrl-C interrupts it.
class Listener {
 public:
  Listener(py::object on_capture, NameSet needs)
      : on_capture_(std::move(on_capture)), needs_(std::move(needs)) {}

  const NameSet& needs() const { return needs_; }
  const std::atomic<bool>& stop() const { return is_over_; }

  /// Called by several threads; those of later captures wait, and with them the run.
  void take(const Capture& capture) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return is_over_ || capture.index == next_; });
    if (is_over_) return;
    given_ = copy_of(capture, needs_);
    changed_.notify_all();
    changed_.wait(lock, [&] { return is_over_ || capture.index < next_; });
  }

  /// Calls the function until end(), without the interpreter's lock between two calls.
  void serve() {
    constexpr std::chrono::milliseconds kSignalPause(50);
    std::unique_lock lock(mutex_);
    while (!is_ended_) {
      changed_.wait_for(lock, kSignalPause, [&] { return given_ || is_ended_; });
      const std::shared_ptr<const StoredCapture> stored = std::exchange(given_, nullptr);
      const bool is_wanted = stored && !is_over_;
      // Not while the interpreter is locked: who has that lock may wait for this one.
      lock.unlock();
      const bool goes_on = is_wanted ? call(stored) : !has_signal();
      lock.lock();
      if (is_wanted) ++next_;
      if (!goes_on) is_over_ = true;
      changed_.notify_all();
    }
  }

  /// There are no more captures.
  void end() {
    const std::lock_guard lock(mutex_);
    is_ended_ = true;
    changed_.notify_all();
  }

  /// What the function threw, or Ctrl-C.
  std::exception_ptr error() const { return error_; }

 private:
  bool call(std::shared_ptr<const StoredCapture> stored) {
    const py::gil_scoped_acquire python;
    try {
      return !on_capture_(capture_of(std::move(stored), made_holds())).is(py::bool_(false));
    } catch (...) {
      keep(std::current_exception());
      return false;
    }
  }

  /// Ctrl-C while the function is not at work.
  bool has_signal() {
    const py::gil_scoped_acquire python;
    if (PyErr_CheckSignals() == 0) return false;
    keep(std::make_exception_ptr(py::error_already_set()));
    return true;
  }

  /// The first one.
  void keep(std::exception_ptr error) {
    if (!error_) error_ = std::move(error);
  }

  py::object on_capture_;
  NameSet needs_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::shared_ptr<const StoredCapture> given_;  ///< Number next_, not handed over yet.
  int next_ = 0;
  bool is_ended_ = false;
  std::exception_ptr error_;
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
  add<ListenerWriter>(registrar, "on_capture", "Hands captures to a Python function.");
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
void make_captures(const GlobalOptions& options, const Value& job, const Listener& own) {
  const JobServices services = make_job_services(options, job, log_to_python, register_listener);
  services.host->stop_on(own.stop());
  JobAssembly assembly = assemble_job(job, *services.registry, *services.host, services.assets_root,
                                      program_version(), AssembleFor::Run);
  RunOptions run;
  run.stop = &own.stop();
  run.encodes_in_order = true;
  run_in_memory(assembly, *services.host, run);
}

void listen(const std::string& program, const Value& given, const py::object& on_capture,
            const std::vector<std::string>& needs, int threads) {
  if (listener) throw Error(ErrorKind::Usage, "run() with on_capture is at work already");
  GlobalOptions options;
  options.program = program;
  options.threads = threads;
  Value job = given;
  Value writer = Value::make_map();
  writer.set("type", Value::text("on_capture"));
  Value writers = Value::make_list();
  writers.list.push_back(std::move(writer));
  job.set("writers", std::move(writers));

  Listener own(on_capture, NameSet(needs.begin(), needs.end()));
  listener = &own;
  const std::unique_ptr<Listener*, void (*)(Listener**)> forget(
      &listener, [](Listener** held) { *held = nullptr; });
  std::exception_ptr failed;
  {
    const py::gil_scoped_release unlocked;
    std::thread maker([&] {
      try {
        make_captures(options, job, own);
      } catch (const Interrupted&) {
        // Whoever ended it knows.
      } catch (...) {
        failed = std::current_exception();
      }
      own.end();
    });
    own.serve();
    maker.join();
  }
  if (own.error()) std::rethrow_exception(own.error());
  if (failed) std::rethrow_exception(failed);
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
      const py::object raised =
          py::reinterpret_borrow<py::object>(error_class)(text_of(error.what()));
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
  bind_scenes(module);
  bind_captures(module);
  bind_given(module);
  module.def("find_datasets", &find_in, py::arg("program"), py::arg("folder"));
}
