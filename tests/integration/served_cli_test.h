// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <memory>

#include "gtest/gtest.h"

#include "client/cli/session/server_process.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

namespace tissueform::testing {

// A test with a folder of its own, in which programs run, and a real server that keeps nothing.
class ServedCliTest : public CliTest {
 protected:
  void SetUp() override {
    CliTest::SetUp();
    ASSERT_OK_AND_ASSIGN(server_,
                         ServerProcess::Start(ProgramPath("tissueform-server"),
                                              {"--in-memory", "--port", "0", "--log-level", "warn"},
                                              std::chrono::seconds(60)));
  }

  std::unique_ptr<ServerProcess> server_;
};

}  // namespace tissueform::testing
