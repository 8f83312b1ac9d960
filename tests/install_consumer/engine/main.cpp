// A program of somebody else: runs a job into a folder, opens what it wrote, and runs the job again
// into a writer of its own.
#include <diorama/engine.h>

#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <string>

namespace {

constexpr const char* kJob = R"(
seed: 3
total_captures: 4
environments:
  - {type: shapes, shapes: [cube]}
objects:
  - {type: shapes, name: targets, under: /Assets, count: 2, label_pattern: "^"}
cameras:
  - {type: pinhole, name: cam, count: 1, width: 32, height: 24}
renderer: {type: "null"}
timeline:
  - {capture: floating, count: 4}
writers:
  - {type: BasicWriter, name: basic, rgb: true, distance_to_camera: true, camera_params: true}
)";

int handed_on = 0;

class CountingWriter final : public diorama::Writer {
 public:
  struct Params {
    void visit(diorama::ParamVisitor&) {}
  };
  CountingWriter(Params, diorama::Host&) {}
  diorama::NameSet needs() const override { return {std::string(diorama::kColor.name)}; }
  void write(const diorama::Capture& capture, diorama::CaptureFiles&) const override {
    if (capture.index != handed_on) throw std::logic_error("captures come in their order");
    if (capture.frames.at(0).get(diorama::kColor).width() == 32) ++handed_on;
  }
};

void expect(bool holds, const char* what) {
  if (!holds) throw std::runtime_error(what);
}

void run(const char* folder) {
  int messages = 0;
  diorama::EngineOptions options;
  options.log = [&](diorama::LogLevel, std::string_view) { ++messages; };
  options.components = [](diorama::Registrar& registrar) {
    diorama::add<CountingWriter>(registrar, "counting_writer", "Counts captures.");
  };
  diorama::Engine engine(options);
  const std::string place = std::string(folder) + "/dataset";

  int total = 0;
  diorama::RunJobOptions into_files;
  into_files.progress = [&](const diorama::JobProgress& progress) { total = progress.total; };
  const diorama::Value job = engine.parse_job(kJob, {{}, 7, place});
  const diorama::RunJobResult made = engine.run_job(job, into_files);
  expect(made.is_finished && made.captures == 4 && total == 4, "the job did not run");
  try {
    engine.run_job(job);
    expect(false, "a dataset was written twice");
  } catch (const diorama::Error& error) {
    expect(error.kind() == diorama::ErrorKind::Output, error.what());
  }

  const auto places = engine.find_datasets(made.dataset);
  expect(places.size() == 1 && places[0].reader == "BasicReader", "the dataset is not found");
  const auto dataset = engine.open_dataset(made.dataset);
  const diorama::StoredCapture stored =
      dataset->read(3, {std::string(diorama::kColor.name), "instances"});
  std::printf("%s, %zu captures, the last %d x %d\n", dataset->info().format.c_str(),
              dataset->info().captures.size(), stored.capture.frames.at(0).camera.width,
              stored.capture.frames.at(0).camera.height);

  diorama::RunJobOptions into_memory;
  into_memory.keeps_files = false;
  into_memory.encodes_in_order = true;
  diorama::JobChanges changes;
  changes.sets = {"writers=[{type: counting_writer}]", "total_captures=3"};
  const diorama::RunJobResult counted =
      engine.run_job(engine.parse_job(kJob, changes), into_memory);
  expect(counted.dataset.empty() && handed_on == 3, "captures were not handed on");

  std::atomic<bool> stop = true;
  into_memory.stop = &stop;
  expect(engine.run_job(engine.parse_job(kJob, changes), into_memory).is_stopped,
         "it did not stop");
  try {
    engine.check_job(engine.parse_job("renderer: {type: nil}\nnonsense: 1", {}, "given"));
    expect(false, "a bad job was accepted");
  } catch (const diorama::Error& error) {
    expect(error.kind() == diorama::ErrorKind::Config, error.what());
    expect(std::strstr(error.what(), "given:2:1") != nullptr, error.what());
  }
  expect(messages > 0, "nothing was logged");
  std::printf("engine %s: %d captures handed on\n", diorama::Engine::version().c_str(), handed_on);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    run(argc > 1 ? argv[1] : ".");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
