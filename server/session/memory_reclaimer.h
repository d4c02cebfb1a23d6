// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <thread>

#include "server/session/limits.h"
#include "server/session/memory_budget.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session_registry.h"

namespace tissueform {

// Frees memory for reservations that do not fit into the budget, on a thread of its own, as long as
// it lives: sessions and meshes that are not in use leave memory.
class MemoryReclaimer {
 public:
  // All pointers must outlive it.
  MemoryReclaimer(const ServiceLimits& limits, MemoryBudget* budget, SessionRegistry* registry,
                  MeshCatalog* catalog);
  // Reservations that wait are refused.
  ~MemoryReclaimer();
  MemoryReclaimer(const MemoryReclaimer&) = delete;
  MemoryReclaimer& operator=(const MemoryReclaimer&) = delete;

 private:
  void Reclaim(int64_t bytes);
  void ReclaimOf(const std::string& owner, int64_t bytes);

  const ServiceLimits limits_;
  MemoryBudget* const budget_;
  SessionRegistry* const registry_;
  MeshCatalog* const catalog_;
  std::thread thread_;
};

}  // namespace tissueform
