// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/memory_reclaimer.h"

#include <optional>

#include "spdlog/spdlog.h"

namespace tissueform {
namespace {

// Of the memory budget: how far sessions that are not in use are evicted once something does not
// fit. The high watermark is the budget itself.
constexpr double kLowWatermark = 0.8;

}  // namespace

MemoryReclaimer::MemoryReclaimer(const ServiceLimits& limits, MemoryBudget* budget,
                                 SessionRegistry* registry, MeshCatalog* catalog)
    : limits_(limits), budget_(budget), registry_(registry), catalog_(catalog) {
  budget_->BeginReclaiming();
  thread_ = std::thread([this] {
    while (const std::optional<MemoryBudget::Shortage> shortage = budget_->WaitForShortage()) {
      if (shortage->owner.empty()) {
        Reclaim(shortage->bytes);
      } else {
        ReclaimOf(shortage->owner, shortage->bytes);
      }
      budget_->AnswerShortage();
    }
  });
}

MemoryReclaimer::~MemoryReclaimer() {
  budget_->EndReclaiming();
  thread_.join();
}

void MemoryReclaimer::ReclaimOf(const std::string& owner, int64_t bytes) {
  const MemoryBudget* account = budget_->AccountOf(owner);
  registry_->table().Evict(
      [&] { return bytes <= account->limit_bytes() - account->reserved_bytes(); }, owner);
}

void MemoryReclaimer::Reclaim(int64_t bytes) {
  const int64_t limit = budget_->limit_bytes();
  // Down to the low watermark, so that the next reservation finds room.
  const auto low = static_cast<int64_t>(kLowWatermark * static_cast<double>(limit));
  const auto fits = [this, bytes](int64_t watermark) {
    return budget_->reserved_bytes() <= watermark - bytes;
  };
  const auto enough = [&] { return fits(low); };
  registry_->table().Evict(enough);
  // Afterwards: a mesh is idle only when no session holds it.
  int meshes = 0;
  if (catalog_->keeps_meshes()) {
    if (!enough()) meshes = catalog_->RemoveIdle(SessionTable::kInUse);
  } else if (!fits(limit)) {
    registry_->sync().RemoveIdle();
    meshes = catalog_->RemoveIdle(limits_.session_idle_ttl);
  }
  if (meshes > 0) spdlog::info("{} unused meshes were evicted from memory", meshes);
}

}  // namespace tissueform
