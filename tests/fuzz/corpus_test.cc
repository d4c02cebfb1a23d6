// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <vector>

#include "gtest/gtest.h"

#include "tests/fuzz/fuzz_target.h"
#include "tests/testing/test_paths.h"

// What the fuzzers start from, and what they have found, in the normal build too.
namespace tissueform::fuzz {
namespace {

struct Target {
  const char* name;  // and folder of its corpus
  std::function<void(const uint8_t*, size_t)> run;
};

class CorpusTest : public ::testing::TestWithParam<Target> {
 protected:
  std::vector<std::string> Inputs() const {
    std::vector<std::string> inputs;
    const std::filesystem::path folder =
        testing::SourcePath(std::string("tests/fuzz/corpus/") + GetParam().name);
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      std::ifstream stream(entry.path(), std::ios::binary);
      inputs.emplace_back(std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>());
    }
    return inputs;
  }
  void Run(const std::string& input) const {
    GetParam().run(reinterpret_cast<const uint8_t*>(input.data()), input.size());
  }
};

TEST_P(CorpusTest, SurvivesEveryInput) {
  const std::vector<std::string> inputs = Inputs();
  EXPECT_GE(inputs.size(), 2U);
  for (const std::string& input : inputs) Run(input);
}

TEST_P(CorpusTest, SurvivesEveryTruncatedInput) {
  for (const std::string& input : Inputs()) {
    for (size_t size = 0; size < input.size(); size += 1 + input.size() / 64) {
      Run(input.substr(0, size));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Targets, CorpusTest,
    ::testing::Values(
        Target{"plan", FuzzPlan}, Target{"mesh_validation", FuzzMeshValidation},
        Target{"mesh_payload", FuzzMeshPayload}, Target{"dicom_series", FuzzDicomSeries},
        Target{"volume_header", FuzzVolumeHeader}, Target{"labels", FuzzLabels},
        Target{"recipe", FuzzRecipe}, Target{"medit", FuzzMeditLines},
        Target{"displacements", FuzzDisplacements}, Target{"store_record", FuzzStoreRecord},
        Target{"deform_stream", FuzzDeformStream}, Target{"case_file", FuzzCaseFile},
        Target{"case_upload", FuzzCaseUpload}, Target{"answers", FuzzAnswers},
        Target{"socket_frame", FuzzSocketFrame}, Target{"web_request", FuzzWebRequest},
        Target{"gateway_connection", FuzzGatewayConnection}, Target{"token", FuzzToken},
        Target{"token_keys", FuzzTokenKeys}, Target{"multipart", FuzzMultipart},
        Target{"instance_header", FuzzInstanceHeader}, Target{"zip", FuzzZip},
        Target{"transform", FuzzTransform}, Target{"markups", FuzzMarkups}),
    [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace tissueform::fuzz
