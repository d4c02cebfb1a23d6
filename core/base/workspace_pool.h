// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "core/base/mutex.h"

namespace tissueform {

// Workspaces for work that several threads do at once on constant data: each borrows one for
// exclusive use. The pool holds as many as were ever in use at the same time.
//
// Thread-safe.
template <typename Workspace>
class WorkspacePool {
 public:
  // Gives the workspace back when it ends. The pool must outlive it.
  class Lease {
   public:
    Lease(WorkspacePool* pool, std::unique_ptr<Workspace> workspace)
        : pool_(*pool), workspace_(std::move(workspace)) {}
    ~Lease() {
      MutexLock lock(pool_.mutex_);
      pool_.free_.push_back(std::move(workspace_));
    }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;

    Workspace* operator->() const { return workspace_.get(); }
    Workspace& operator*() const { return *workspace_; }

   private:
    WorkspacePool& pool_;
    std::unique_ptr<Workspace> workspace_;
  };

  Lease Borrow() {
    {
      MutexLock lock(mutex_);
      if (!free_.empty()) {
        std::unique_ptr<Workspace> workspace = std::move(free_.back());
        free_.pop_back();
        return Lease(this, std::move(workspace));
      }
    }
    return Lease(this, std::make_unique<Workspace>());
  }

 private:
  Mutex mutex_;
  std::vector<std::unique_ptr<Workspace>> free_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
