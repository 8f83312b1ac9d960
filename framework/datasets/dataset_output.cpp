// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/dataset_output.h"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>

#include "framework/pipeline/writer_queue.h"
#include "framework/plugins/plugin_call.h"

namespace diorama {
namespace {

constexpr std::size_t kMostQueueBytes = std::size_t(256) << 20;

std::string writer_name(const std::string& name) { return "writer '" + name + "'"; }

OutputStore::Options store_options(bool overwrite) {
  OutputStore::Options options;
  if (overwrite) options.existing = OutputStore::Existing::Overwrite;
  return options;
}

}  // namespace

OutputFolders output_folders_of(const std::filesystem::path& folder,
                                const std::vector<NamedWriter>& writers) {
  OutputFolders folders{folder, ".", {}};
  for (const NamedWriter& each : writers) folders.writers.push_back({each.name, each.name});
  return folders;
}

DatasetOutput::DatasetOutput(const std::filesystem::path& folder, std::vector<NamedWriter> writers,
                             int capture_count, bool overwrite)
    : writers_(std::move(writers)),
      store_(file_system_, output_folders_of(folder, writers_), capture_count,
             store_options(overwrite)) {}

void DatasetOutput::open(const DatasetInfo& info, const std::string& dataset_json) {
  store_.join(dataset_json);
  store_.open();
  Transaction transaction = store_.begin_transaction();
  for (std::size_t i = 0; i < writers_.size(); ++i) {
    CollectedFiles files(transaction, i, writers_[i].name);
    call_component(writer_name(writers_[i].name), [&] { writers_[i].writer->begin(info, files); });
  }
  store_.commit_begin(transaction);
}

void DatasetOutput::write(const std::function<void(const Take&)>& give, Host& host) {
  const int threads = std::clamp(host.thread_count(), 1, 4);
  std::optional<WriterQueue> queue;
  give([&](Capture capture) {
    PendingCapture pending;
    pending.capture = std::move(capture);
    if (!queue) {
      // Captures are read faster than written: as many wait as are at work, and memory stays flat.
      const std::size_t few = 2 * std::size_t(threads) * capture_bytes(pending);
      WriterQueue::Options options;
      options.threads = threads;
      options.max_bytes = std::min(few, kMostQueueBytes);
      queue.emplace(options, WriterQueue::Work{[this](const PendingCapture& each) {
                                                 return encode(each.capture);
                                               },
                                               [this](int index, Transaction& transaction) {
                                                 store_.commit_capture(index, transaction);
                                               }});
    }
    static_cast<void>(queue->push(std::move(pending)));  // Waits for room.
  });
  if (queue) queue->drain();
}

Transaction DatasetOutput::encode(const Capture& capture) {
  Transaction transaction = store_.capture_transaction(capture.index);
  for (std::size_t i = 0; i < writers_.size(); ++i) {
    CollectedFiles files(transaction, i, writers_[i].name);
    call_component(writer_name(writers_[i].name),
                   [&] { writers_[i].writer->write(capture, files); });
  }
  return transaction;
}

void DatasetOutput::finish() {
  if (!store_.claim_finish()) return;
  Transaction transaction = store_.finish_transaction();
  for (std::size_t i = 0; i < writers_.size(); ++i) {
    CollectedFiles files(transaction, i, writers_[i].name);
    const RecordReader records = [&](const RecordVisitor& visit) { store_.read_records(i, visit); };
    call_component(writer_name(writers_[i].name),
                   [&] { writers_[i].writer->finish(records, files); });
  }
  store_.commit_finish(transaction);
}

void DatasetOutput::close() { store_.close(); }

}  // namespace diorama
