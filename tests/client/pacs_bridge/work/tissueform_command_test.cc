// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/process/tissueform_command.h"

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <unistd.h>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

constexpr std::chrono::seconds kLong{600};

class TissueformCommandTest : public ::testing::Test {
 protected:
  TissueformCommandTest()
      : folder_(EmptyTestFolder("tissueform_command")),
        silent_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)),
        cancel_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    sockaddr_in place = {};
    place.sin_family = AF_INET;
    place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof(place);
    EXPECT_EQ(bind(silent_, reinterpret_cast<sockaddr*>(&place), length), 0);
    EXPECT_EQ(listen(silent_, 8), 0);
    EXPECT_EQ(getsockname(silent_, reinterpret_cast<sockaddr*>(&place), &length), 0);
    port_ = ntohs(place.sin_port);
  }
  ~TissueformCommandTest() override {
    close(silent_);
    close(cancel_);
  }

  absl::Status Run(const std::vector<std::string>& words, std::chrono::seconds most = kLong) {
    return RunTissueform(words, "this", (folder_ / "log").string(), most, cancel_);
  }
  // Waits for a server that says nothing.
  std::vector<std::string> Waiting() const {
    return {"prediction", "list", "--server", absl::StrCat("127.0.0.1:", port_)};
  }
  void Cancel() const {
    const uint64_t one = 1;
    EXPECT_EQ(write(cancel_, &one, sizeof(one)), static_cast<ssize_t>(sizeof(one)));
  }

  const std::filesystem::path folder_;
  const int silent_;
  const int cancel_;
  int port_ = 0;
};

TEST_F(TissueformCommandTest, SuccessIsNotAnError) { EXPECT_THAT(Run({"--version"}), IsOk()); }

TEST_F(TissueformCommandTest, ErrorQuotesTheLastLineOfTheCommand) {
  EXPECT_THAT(
      Run({"case", "render", "nothing.tfcase"}),
      StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("this failed: tissueform: ")));
}

TEST_F(TissueformCommandTest, CancellationEndsTheCommand) {
  Cancel();
  EXPECT_THAT(Run(Waiting()), StatusIs(absl::StatusCode::kCancelled));
}

TEST_F(TissueformCommandTest, ExceedingItsLimitsEndsTheCommand) {
  const auto make = [&](const char* keys, const ProgramLimits& limits) {
    return RunTissueform({"token", "keygen", "--out", (folder_ / keys).string()}, "this",
                         (folder_ / "log").string(), kLong, cancel_, limits);
  };
  EXPECT_THAT(make("few", {.max_file_bytes = 16}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("this failed: ")));
  EXPECT_THAT(make("enough", {.max_file_bytes = 1 << 20}), IsOk());
}

TEST_F(TissueformCommandTest, ADiskWithoutRoomIsKnown) {
  EXPECT_FALSE(HasRoom("/proc")) << "nothing can be written there";
  EXPECT_TRUE(HasRoom("/nowhere")) << "what cannot be asked is no reason to give up";
}

TEST_F(TissueformCommandTest, TimeoutEndsTheCommand) {
  EXPECT_THAT(Run(Waiting(), std::chrono::seconds(0)),
              StatusIs(absl::StatusCode::kDeadlineExceeded));
}

}  // namespace
}  // namespace tissueform::testing
