// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <fstream>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/cpp/tissueform_client.h"
#include "core/mesh/payload/sha256.h"
#include "core/planning/case_file/case_reader.h"
#include "tests/integration/served_cli_test.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

// `tissueform case publish|list|show|delete` as a real program with a real server.
namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class CaseCommandTest : public ServedCliTest {
 protected:
  void SetUp() override {
    ServedCliTest::SetUp();
    ASSERT_OK_AND_ASSIGN(client_, TissueformClient::Connect(server_->address(), {}));
    ASSERT_THAT(Run({"case", "pack", SourcePath("tests/data/plans/tongue/plan.json"), "--out",
                     "tongue.tfcase", "--title", "Tongue forward"}),
                Succeeds());
  }
  ProcessResult OfServer(std::vector<std::string> words) const {
    words.insert(words.begin(), "case");
    words.insert(words.end(), {"--server", server_->address()});
    return Run(words);
  }

  std::unique_ptr<TissueformClient> client_;
};

TEST_F(CaseCommandTest, APublishedCaseIsTheFileAndItsMeshIsThere) {
  const std::string bytes = Read("tongue.tfcase");
  const std::string name = "cases/" + Sha256Hex({bytes});
  const ProcessResult published = OfServer({"publish", "tongue.tfcase"});
  EXPECT_THAT(published, Succeeds());
  EXPECT_THAT(published.out, AllOf(HasSubstr(name), HasSubstr("Tongue forward")));
  EXPECT_THAT(client_->cases().Read(name).value_or(""), bytes);
  ASSERT_OK_AND_ASSIGN(const CaseFile contents, ParseCase(bytes));
  EXPECT_THAT(client_->GetMesh(contents.mesh.name), IsOk());
  EXPECT_THAT(OfServer({"publish", "tongue.tfcase", "--title", "another"}), Succeeds());
  const ProcessResult listed = OfServer({"list"});
  EXPECT_THAT(listed, Succeeds());
  EXPECT_THAT(listed.out, AllOf(HasSubstr(name), HasSubstr("Tongue forward"),
                                Not(HasSubstr("another")), HasSubstr("1 cases")));
  const ProcessResult shown = OfServer({"show", name.substr(6)});
  EXPECT_THAT(shown, Succeeds());
  EXPECT_THAT(shown.out, AllOf(HasSubstr(name), HasSubstr(absl::StrCat(bytes.size()))));
  EXPECT_THAT(OfServer({"delete", name}), Succeeds());
  EXPECT_THAT(OfServer({"show", name}), FailsWith(1, HasSubstr("no case")));
}

TEST_F(CaseCommandTest, DoesNotSendAFileThatIsNotACase) {
  std::ofstream(Path("text.tfcase")) << "a text";
  EXPECT_THAT(OfServer({"publish", "text.tfcase"}),
              FailsWith(1, AllOf(HasSubstr("text.tfcase"), HasSubstr("case pack"))));
  EXPECT_THAT(OfServer({"publish", "none.tfcase"}), FailsWith(1, HasSubstr("none.tfcase")));
  std::string cut = Read("tongue.tfcase");
  cut.resize(cut.size() - 100);
  std::ofstream(Path("cut.tfcase"), std::ios::binary) << cut;
  EXPECT_THAT(OfServer({"publish", "cut.tfcase"}), FailsWith(1, HasSubstr("cut.tfcase")));
  EXPECT_THAT(OfServer({"list"}).out, HasSubstr("0 cases"));
}

TEST_F(CaseCommandTest, HelpTeaches) {
  const ProcessResult help = Run({"case", "publish", "--help"});
  EXPECT_THAT(help, Succeeds());
  EXPECT_THAT(help.out, AllOf(HasSubstr("treat it like the CT"), HasSubstr("Example")));
}

}  // namespace
}  // namespace tissueform::testing
