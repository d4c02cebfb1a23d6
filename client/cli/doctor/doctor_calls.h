// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "grpcpp/channel.h"
#include "grpcpp/client_context.h"

#include "client/cli/doctor/doctor_report.h"
#include "client/cpp/session_routes.h"

namespace tissueform {

// The questions of the doctor that are calls. Each ends within a deadline of its own.
class DoctorCalls {
 public:
  explicit DoctorCalls(std::shared_ptr<grpc::Channel> channel) : channel_(std::move(channel)) {}

  // Whether the health service says SERVING.
  DoctorLine CheckHealth() const;
  // Which identity the server sees, and how far the clocks are apart: two lines. False: the server
  // does not recognize the caller, and all other calls would fail the same way.
  bool CheckCaller(DoctorReport* report) const;
  // Versions of both sides, and what the server takes: two lines.
  void CheckServer(DoctorReport* report);
  // Uploads a mesh of two tets, makes a session of it, drags it and deletes both; in a cluster
  // (known from CheckServer) at the server that has the session, and again if a session is lost.
  DoctorLine CheckWork();

 private:
  // Deletes both, as far as they exist.
  void Delete(const std::string& mesh, const std::string& session);

  const std::shared_ptr<grpc::Channel> channel_;
  SessionRoutes routes_;  // self-synchronised
};

}  // namespace tissueform
