// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/guarded_dataset.h"

#include <utility>

#include "diorama/error.h"
#include "framework/datasets/check_names.h"
#include "framework/plugins/plugin_call.h"

namespace diorama {
namespace {

class GuardedDataset final : public StoredDataset {
 public:
  explicit GuardedDataset(std::unique_ptr<const StoredDataset> dataset)
      : dataset_(std::move(dataset)) {}

  const StoredInfo& info() const override { return dataset_->info(); }
  const ReadLog& log() const override { return dataset_->log(); }
  StoredCapture read(std::size_t i, const NameSet& wanted) const override {
    try {
      return call_component("reader of " + info().format,
                            [&] { return dataset_->read(i, wanted); });
    } catch (const Stopped&) {
      throw;
    } catch (const Error& error) {
      StoredCapture lost;
      lost.capture.index = info().captures.at(i);
      lost.log.check(false, {kFilesCanBeRead, ".", lost.capture.index, "", "", error.what(), ""});
      return lost;
    }
  }

 private:
  std::unique_ptr<const StoredDataset> dataset_;
};

}  // namespace

std::unique_ptr<const StoredDataset> guarded(std::unique_ptr<const StoredDataset> dataset) {
  return std::make_unique<GuardedDataset>(std::move(dataset));
}

}  // namespace diorama
