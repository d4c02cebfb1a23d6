// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <memory>
#include <utility>

#include "server/platform/storage/data_folder.h"
#include "server/store/durable_store.h"
#include "server/store/sql_stores.h"
#include "tests/server/store/stores_case.h"

namespace tissueform {
namespace {

// A durable store in a folder that goes with it.
class ScratchDurableStore final : public Stores {
 public:
  explicit ScratchDurableStore(UnixClock clock)
      : store_(*DurableStore::Open(*DataFolder::Open(folder_ / "data"),
                                   {.clock = std::move(clock)})) {}

  SessionStore& sessions() override { return store_->sessions(); }
  MeshStore& meshes() override { return store_->meshes(); }
  UploadStore& uploads() override { return store_->uploads(); }
  PredictionStore& predictions() override { return store_->predictions(); }
  CaseStore& cases() override { return store_->cases(); }
  SqlDatabase& database() override { return store_->database(); }
  bool keeps() const override { return true; }

 private:
  const ScratchFolder folder_;
  const std::unique_ptr<DurableStore> store_;
};

}  // namespace

std::vector<StoresCase> AllStores() {
  return {{"InMemory", [](UnixClock clock) { return *OpenInMemoryStores(std::move(clock)); }},
          {"Durable", [](UnixClock clock) {
             return std::make_unique<ScratchDurableStore>(std::move(clock));
           }}};
}

}  // namespace tissueform
